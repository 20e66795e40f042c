"""What every route answers when it does not do what was asked: one form, one sentence.

    {"error": {"code": "refused", "sentence": "...", "mode": "RUNNING", "request": "HOME"}}

The status says whose turn it is: 401 and 403 access, 404 no such thing, 409 not now (the
machine's mode, the control token, a name that is taken), 413 and 422 what was sent, 429 too
often, 503 the controller's service is not there or the store cannot be used, 507 the disk is full;
408: the rest of what was announced did not come.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from fastapi.responses import JSONResponse
from pydantic import BaseModel

from controller import catalogue


class ErrorFacts(BaseModel):
    """Why something was not done."""

    code: str
    sentence: str
    sentence_de: str | None = None  # the same in German, where it is known
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
        sentence: str,
        *,
        mode: str | None = None,
        request: str | None = None,
        sentence_de: str | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(sentence)
        self.status, self.headers = status, dict(headers or {})
        self.facts = ErrorFacts(
            code=code, sentence=sentence, sentence_de=sentence_de, mode=mode, request=request
        )

    @classmethod
    def told(
        cls, status: int, code: str, key: str, *, headers: Mapping[str, str] | None = None, **values: Any
    ) -> Refusal:
        """With the catalogue's text of that key, in both languages; a mode and a request among the values
        are facts of their own, too.
        """
        english, german = catalogue.in_both(key, **values)
        asked = {name: values[name] for name in ("mode", "request") if name in values}
        return cls(status, code, english, sentence_de=german, headers=headers, **asked)

    def response(self) -> JSONResponse:
        body = ErrorAnswer(error=self.facts).model_dump()
        return JSONResponse(body, self.status, self.headers)


# For OpenAPI: what a route may answer beside success.
DESCRIPTIONS = {
    401: "Not logged in, or the log-in ended.",
    403: "The role does not allow it, or the request did not come from this server's own page.",
    404: "There is no such thing.",
    408: "The sender fell silent before the end of what it announced; send it again.",
    405: "The path does not know this method; Allow says which.",
    409: "Not now: mode of the machine, control token, or a name that is taken.",
    413: "Too large.",
    422: "What was sent is not what the schema says.",
    429: "Too often; Retry-After says when again (s).",
    503: "The controller's service does not answer, or the store cannot be used.",
    507: "The disk is full.",
}


def documented(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI entry of every status named."""
    return {s: {"model": ErrorAnswer, "description": DESCRIPTIONS[s]} for s in sorted(statuses)}


# How pydantic calls that a value does not fit -> the catalogue's word for it, and where its limit stands.
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
}


def of_form(errors: Iterable[Mapping[str, Any]]) -> Refusal:
    """About the first thing that does not fit the schema: where, what, what to do."""
    error = next(iter(errors), {})
    found = repr(error.get("input"))
    what, limit = FORMS.get(str(error.get("type")), ("other", ""))
    return Refusal.told(
        422,
        "form",
        "form",
        where=".".join(str(part) for part in error.get("loc", ())) or "the request",
        found=found if len(found) <= 60 else found[:57] + "...",
        what=catalogue.Key(f"form.{what}"),
        limit=(error.get("ctx") or {}).get(limit),
        message=str(error.get("msg", "does not fit")).rstrip("."),
    )
