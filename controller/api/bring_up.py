"""A bring-up at the page: one step at a time, conducted by a worker process, and its operator's answers."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
from collections.abc import Mapping
from typing import Any

from controller.api.answers import Refusal
from controller.messages import Message, message

WORKER = (sys.executable, "-m", "controller.cli.bring_up_worker")


class BringUp:
    """The step under way, what its operator is asked, and why steps were not ended."""

    def __init__(self) -> None:
        self.step = ""  # "" = none is under way
        self.question: Mapping[str, Any] | None = None  # {number, question, text}
        self.not_done: dict[str, Message] = {}  # by step
        self._child: asyncio.subprocess.Process | None = None
        self._listening: asyncio.Task[None] | None = None

    async def begin(self, job: Mapping[str, Any]) -> None:
        """Raises Refusal while a step is under way, or where no worker can be started."""
        if self.step:
            raise Refusal.of(409, "busy", "bringup.busy", step=self.step)
        self.step, self.question = str(job["step"]), None
        self.not_done.pop(self.step, None)
        pipe, nothing = asyncio.subprocess.PIPE, asyncio.subprocess.DEVNULL
        try:
            self._child = await asyncio.create_subprocess_exec(
                *WORKER, stdin=pipe, stdout=pipe, stderr=nothing
            )
        except OSError as error:
            self.step = ""
            raise Refusal.of(503, "unread", "bringup.no_worker") from error
        self._say(self._child, {**job, "parent": os.getpid()})
        self._listening = asyncio.create_task(self._listen(self._child, self.step))

    async def _listen(self, child: asyncio.subprocess.Process, step: str) -> None:
        """To the end of the worker; one that dies has not ended its step."""
        why: Message | None = message("bringup.no_worker")
        try:
            assert child.stdout is not None
            async for line in child.stdout:
                told = json.loads(line)
                if "ended" in told:
                    why = told["ended"]
                else:
                    self.question = told if told["question"] else None
        finally:
            with contextlib.suppress(ProcessLookupError):
                child.kill()
            if why is not None:
                self.not_done[step] = why
            self.step, self.question, self._child = "", None, None

    def answer(self, number: int, answer: float | bool | None) -> None:
        """What the operator says to a question; None: he leaves the step. Raises Refusal where it is none."""
        if self._child is None or self.question is None or self.question["number"] != number:
            raise Refusal.of(409, "late", "bringup.no_question")
        self._say(self._child, {"number": number, "answer": answer})
        self.question = None

    @staticmethod
    def _say(child: asyncio.subprocess.Process, what: Mapping[str, Any]) -> None:
        assert child.stdin is not None
        child.stdin.write(json.dumps(what).encode() + b"\n")

    async def close(self) -> None:
        """The panel ends; a run that the step has begun goes on as any."""
        if self._listening is not None:
            self._listening.cancel()
            await asyncio.gather(self._listening, return_exceptions=True)
