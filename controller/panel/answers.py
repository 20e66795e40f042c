"""What every route answers when it does not do what was asked: one form, one sentence.

    {"error": {"code": "refused", "sentence": "...", "mode": "RUNNING", "request": "HOME"}}

The status says whose turn it is: 401 and 403 access, 404 no such thing, 409 not now (the
machine's mode, the control token, a name that is taken), 413 and 422 what was sent, 429 too
often, 503 the controller's service is not there.
"""

from __future__ import annotations

import math
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
        cls, status: int, code: str, key: str, headers: Mapping[str, str] | None = None, **values: object
    ) -> Refusal:
        """With the catalogue's text of that key, in both languages."""
        english, german = (catalogue.refusal(key, language, **values) for language in ("en", "de"))
        return cls(status, code, english, sentence_de=german, headers=headers)

    def response(self) -> JSONResponse:
        body = ErrorAnswer(error=self.facts).model_dump()
        return JSONResponse(body, self.status, self.headers)


# For OpenAPI: what a route may answer beside success.
DESCRIPTIONS = {
    401: "Not logged in, or the log-in ended.",
    403: "The role does not allow it, or the request did not come from this server's own page.",
    404: "There is no such thing.",
    405: "The path does not know this method; Allow says which.",
    409: "Not now: mode of the machine, control token, or a name that is taken.",
    413: "Too large.",
    422: "What was sent is not what the schema says.",
    429: "Too often; Retry-After says when again (s).",
    503: "The controller's service does not answer.",
}


def documented(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI entry of every status named."""
    return {s: {"model": ErrorAnswer, "description": DESCRIPTIONS[s]} for s in sorted(statuses)}


def sentence_of(errors: Iterable[Mapping[str, Any]]) -> str:
    """One sentence about the first thing that does not fit the schema: where, what, what to do."""
    for error in errors:
        where = ".".join(str(part) for part in error.get("loc", ())) or "the request"
        found = repr(error.get("input"))
        found = found if len(found) <= 60 else found[:57] + "..."
        what = str(error.get("msg", "does not fit")).rstrip(".")
        return f"{where}: {what} (found {found}); /openapi.json says what is allowed."
    return "The request does not fit; /openapi.json says what is allowed."


def plain(value: Any) -> Any:
    """The value without NaN and infinities, which JSON does not have: None stands for them."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    return value
