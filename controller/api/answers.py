"""What every route answers when it does not do what was asked: one form, one sentence.

    {"error": {"code": "refused", "key": "...", "values": {...}, "sentence": "...", "mode": "RUNNING", ...}}

Inside the panel a text is a key with its values; here, at the edge, it becomes a sentence in the language
that was asked for: of the page's choice, or of ``Accept-Language``.

The status says whose turn it is: 401 and 403 access, 404 no such thing, 409 not now (the
machine's mode, the control token, a name that is taken), 413 and 422 what was sent, 429 too
often, 503 the controller's service is not there or the store cannot be used, 507 the disk is full;
408: the rest of what was announced did not come.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextvars import ContextVar
from typing import Any

from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from starlette.requests import HTTPConnection

from controller import messages
from controller.messages import Message, message, plain

LANGUAGE_COOKIE = "directrix_language"  # which one was chosen on the page
VARY = "Accept-Language, Cookie"
spoken: ContextVar[str] = ContextVar("spoken", default=messages.DEFAULT)  # by who is answered


def language_of(connection: HTTPConnection) -> str:
    """That was chosen on the page, else that is preferred."""
    chosen = connection.cookies.get(LANGUAGE_COOKIE, "")
    return messages.chosen(chosen, connection.headers.get("accept-language", ""))


class Answer(JSONResponse):
    """JSON in which every text has its sentence."""

    def __init__(
        self, content: Any, status_code: int = 200, headers: Mapping[str, str] | None = None, **more: Any
    ) -> None:
        language = spoken.get()
        super().__init__(messages.with_sentences(content, language), status_code, headers, **more)
        self.headers["Content-Language"], self.headers["Vary"] = language, VARY


class Texts(BaseModel):
    """What is said, in the language asked for, and for machines."""

    key: str | None = Field(default=None, description="Of the text; null: nothing is said.")
    values: dict[str, Any] | None = Field(default=None, description="For the places of the text.")
    sentence: str | None = Field(default=None, description="The text in the language asked for.")


class ErrorFacts(Texts):
    """Why something was not done."""

    code: str
    mode: str | None = None  # of the machine, where that is the reason
    request: str | None = None  # what was asked of the machine


class ErrorAnswer(BaseModel):
    """The body of every answer that is not a success."""

    error: ErrorFacts


class Refusal(Exception):
    """Becomes an ErrorAnswer with ``status``; raised by routes and whatever they call."""

    def __init__(
        self,
        status: int,
        code: str,
        text: Message | str,
        *,
        mode: str | None = None,
        request: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        """``text``: a sentence alone where it has no key."""
        self.said = plain(text)
        super().__init__(messages.text(self.said))
        self.status, self.headers = status, dict(headers or {})
        self.facts = ErrorFacts(code=code, mode=mode, request=request, **self.said)

    @classmethod
    def of(
        cls, status: int, code: str, key: str, *, headers: Mapping[str, str] | None = None, **values: Any
    ) -> Refusal:
        """A refusal with the text of that key; a mode and a request among the values are facts of their
        own, too.
        """
        asked = {name: values[name] for name in ("mode", "request") if name in values}
        return cls(status, code, message(key, **values), headers=headers, **asked)

    def response(self) -> JSONResponse:
        return Answer(ErrorAnswer(error=self.facts).model_dump(), self.status, self.headers)


# For OpenAPI: what a route may answer beside success.
DESCRIPTIONS = {
    int(key.removeprefix("http.")): text
    for key, text in messages.of(messages.DEFAULT).texts.items()
    if key.startswith("http.")
}


def documented(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI entry of every status named."""
    return {s: {"model": ErrorAnswer, "description": DESCRIPTIONS[s]} for s in sorted(statuses)}


# How pydantic calls that a value does not fit -> the catalogue's word for it, and where its limit is.
FORMS = {
    "missing": ("missing", ""),
    **dict.fromkeys(("float_type", "float_parsing", "finite_number"), ("number", "")),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), ("whole", "")),
    "greater_than_equal": ("least", "ge"),
    "less_than_equal": ("most", "le"),
    "greater_than": ("above", "gt"),
    "less_than": ("below", "lt"),
    "string_too_short": ("short", "min_length"),
    "string_too_long": ("long", "max_length"),
    "too_short": ("few", "min_length"),
    "too_long": ("many", "max_length"),
    "string_type": ("text", ""),
    "string_pattern_mismatch": ("pattern", "pattern"),
    **dict.fromkeys(("bool_type", "bool_parsing"), ("flag", "")),
    **dict.fromkeys(("literal_error", "enum"), ("one_of", "expected")),
    **dict.fromkeys(("list_type", "tuple_type"), ("list", "")),
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), ("object", "")),
    "extra_forbidden": ("extra", ""),
    "json_invalid": ("json", ""),
}
_QUOTED = re.compile(r"'([^']*)'")  # of what pydantic expects: 'a', 'b' or 'c'


def of_form(errors: Iterable[Mapping[str, Any]]) -> Refusal:
    """About the first thing that does not fit the schema: where, what, what to do."""
    error = next(iter(errors), {})
    found = repr(error.get("input"))
    what, limit = FORMS.get(str(error.get("type")), ("other", ""))
    allowed = (error.get("ctx") or {}).get(limit)
    if what == "one_of":
        allowed = ", ".join(_QUOTED.findall(str(allowed)))
    return Refusal.of(
        422,
        "form",
        "form",
        where=".".join(str(part) for part in error.get("loc", ())) or messages.Key("form.request"),
        found=found if len(found) <= 60 else found[:57] + "...",
        what=messages.Key(f"form.{what}"),
        limit=allowed,
    )
