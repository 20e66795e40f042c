"""Routers on which a route says in one line who is let in, and how it may refuse.

@router.put("/offsets/{name}", MOVE, 409, 422, 503)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from fastapi import APIRouter, Response

from controller.api.access import moves, needs
from controller.api.answers import documented
from controller.api.roles import Role

VIEW, OPERATE, SET_UP, MOVE = needs(Role.VIEW), needs(Role.OPERATE), needs(Role.SET_UP), moves()
LOOKS = (503,)  # statuses of what is asked of the service
MOVES = (409, 422, 503)

Endpoint = TypeVar("Endpoint", bound=Callable[..., Any])
Responses = dict[int | str, dict[str, Any]]


class Router(APIRouter):
    """Routes of one subject."""

    def guarded(
        self, method: str, path: str, guard: Any, *statuses: int, **how: Any
    ) -> Callable[[Endpoint], Endpoint]:
        """``guard``: None where nobody is known yet; ``statuses`` beside 401 and 403; ``carries``: what a
        success carries that is no JSON (``body``); ``how`` else as FastAPI takes it.
        """
        if (carries := how.pop("carries", None)) is not None:
            how |= {"response_class": Response, "responses": carries}
        how["responses"] = {**how.get("responses", {}), **documented(401, 403, *statuses)}
        how["dependencies"] = [] if guard is None else [guard]
        return self.api_route(path, methods=[method], **how)

    def get(self, path: str, *says: Any, **how: Any) -> Callable[[Endpoint], Endpoint]:
        return self.guarded("GET", path, *says, **how)

    def post(self, path: str, *says: Any, **how: Any) -> Callable[[Endpoint], Endpoint]:
        return self.guarded("POST", path, *says, **how)

    def put(self, path: str, *says: Any, **how: Any) -> Callable[[Endpoint], Endpoint]:
        return self.guarded("PUT", path, *says, **how)

    def patch(self, path: str, *says: Any, **how: Any) -> Callable[[Endpoint], Endpoint]:
        return self.guarded("PATCH", path, *says, **how)

    def delete(self, path: str, *says: Any, **how: Any) -> Callable[[Endpoint], Endpoint]:
        return self.guarded("DELETE", path, *says, **how)


def body(media: str, is_text: bool = False) -> Responses:
    """A success of that media type; ``is_text``: OpenAPI has it as a string."""
    return {200: {"content": {media: {"schema": {"type": "string"}} if is_text else {}}}}
