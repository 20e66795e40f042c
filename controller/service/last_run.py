"""The run that is under way, or was last: which one, and what came of it.

Whoever has started one waits for its end by its id, which no other run has and which the list of runs keeps.
"""

from __future__ import annotations

from typing import NamedTuple

from controller.ipc.control_socket import Values
from controller.messages import Message, facts

NOT_STARTED = "not_started"  # result of a run that was being prepared, and moved nothing


class LastRun(NamedTuple):
    """``result``: None while it is under way, else as of a record; ``said``: why it ended early."""

    id: str  # the name of its record
    program: str
    result: str | None = None
    line: int | None = None
    said: Message | None = None

    def to_json(self) -> Values:
        return {"id": self.id, "program": self.program, "result": self.result, "line": self.line} | facts(
            self.said
        )
