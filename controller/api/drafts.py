"""Programs that are being written are read by the machine's own reader, in a process of its own.

Nothing is kept. One is read at a time, and none for long: whoever types asks again in a moment.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from typing import Any

from controller.api.answers import Refusal
from controller.api.store import Store

WORKER = (sys.executable, "-m", "controller.cli.draft_worker")
LONGEST_S = 20.0
MAX_BYTES = 1_000_000


class Drafts:
    """Of one panel."""

    def __init__(self, store: Store, worker: tuple[str, ...] = WORKER) -> None:
        self._store, self._worker, self._busy = store, worker, False

    async def read(self, name: str, text: str) -> list[dict[str, Any]]:
        """What is refused: line and column (1-based), and the sentence. Raises Refusal."""
        if self._busy:
            raise Refusal.told(429, "many", "draft_busy", headers={"Retry-After": "1"})
        self._busy = True
        try:
            files = await asyncio.to_thread(self._store.programs.called_by, name, text.encode())
            job = {"text": text, "name": name, "files": files, "state": str(self._store.folder)}
            return await asyncio.wait_for(self._asked({**job, "parent": os.getpid()}), LONGEST_S)
        except (OSError, ValueError, TimeoutError):
            raise Refusal.told(503, "unread", "draft_unread", name=name) from None
        finally:
            self._busy = False

    async def _asked(self, job: dict[str, Any]) -> list[dict[str, Any]]:
        """Raises OSError and ValueError where the process gives no answer."""
        pipe, nothing = asyncio.subprocess.PIPE, asyncio.subprocess.DEVNULL
        child = await asyncio.create_subprocess_exec(
            *self._worker, stdin=pipe, stdout=pipe, stderr=nothing, limit=MAX_BYTES
        )
        try:
            answer, _ = await child.communicate(json.dumps(job).encode())
            found: list[dict[str, Any]] = json.loads(answer)["refusals"]
            return found
        finally:
            if child.returncode is None:
                child.kill()
