"""Programs are checked after their upload, in a process of their own, one after another.

Reading and planning a long program takes seconds to minutes: never within an answer, never in
the panel's own process. What came out stands in the store, with the progress on the way. A
check belongs to a content on a machine as it is fitted; with other offsets or tools it has
to be asked for again. A start does not depend on any of this: the service checks for itself.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import IO, Any

from controller.api.answers import Refusal
from controller.api.programs import Program, ProgramCheck
from controller.api.quotas import NOBODY, Owner, Turns
from controller.api.store import Store, StoreError
from controller.machine.toml_table import ConfigError
from controller.messages import message
from controller.store import set_up_store

WORKER = (sys.executable, "-m", "controller.cli.check_worker")
LONGEST_S = 3600.0
TELL_S = 0.5  # between two notes of progress


class Checker:
    """Checks what it is asked to, until it is closed."""

    def __init__(self, store: Store, worker: tuple[str, ...] = WORKER) -> None:
        self._store, self._worker = store, worker
        self.tell: Callable[[str], object] = lambda _: None  # the name of what is checked; in the thread
        self._waiting = Turns[tuple[Program, str]]()
        self._child: subprocess.Popen[str] | None = None
        self._closed = False
        self._pending: set[tuple[str, str]] = set()  # content and machine of what waits or runs here
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="checks", daemon=True)
        self._thread.start()

    def machine(self) -> str:
        """The machine as it is fitted, as one hash; "" = no service has ever run on this state folder."""
        with contextlib.suppress(OSError, ConfigError):
            return set_up_store.sum_of(self._store.folder)
        return ""

    def of(self, program: Program) -> ProgramCheck | None:
        """What is known of a program on the machine as it is fitted now. Raises StoreError."""
        return self._store.checks.get(program.sha256, self.machine())

    def waiting(self, owner: Owner) -> int:
        """How many programs of an asker wait."""
        return self._waiting.count(owner)

    def ask(self, program: Program, owner: Owner | None = None) -> None:
        """Have a program checked, unless it was or will be; ``owner``: who asks, None: who uploaded it.

        Raises StoreError.
        """
        machine = self.machine()
        asked = (program.sha256, machine)
        with self._lock:
            known = self._store.checks.get(*asked)  # one that ends is known before it is no longer pending
            if not machine or asked in self._pending or (known and known.state in ("passed", "refused")):
                return
            self._pending.add(asked)
        self._store.checks.set(*asked, "waiting")
        self._waiting.put(owner or (program.uploaded_by, ""), (program, machine))

    def look(self) -> None:
        """Ask for all that came in by other ways, and for what a panel that ended has left.

        What was checked on the machine as it was fitted before is not asked for again by itself.
        Raises StoreError.
        """
        for program in self._store.programs.unchecked():
            self.ask(program)

    def close(self) -> None:
        """End at once; what was under way is looked at again by the next one."""
        with self._lock:
            self._closed = True
            if self._child is not None:
                self._child.kill()
        self._waiting.end()
        self._thread.join()

    # ---- in the thread

    def _run(self) -> None:
        while (asked := self._waiting.take()) is not None and not self._closed:
            program, machine = asked
            with contextlib.suppress(StoreError):  # the store is full or gone; the program stays unchecked
                state, result = self._checked(program, machine)
                if not self._closed:
                    self._keep(program, machine, state, result)
            with self._lock:
                self._pending.discard((program.sha256, machine))

    def _keep(self, program: Program, machine: str, state: str, result: dict[str, Any]) -> None:
        self._store.checks.set(program.sha256, machine, state, 1.0, result)
        self.tell(program.name)

    def _checked(self, program: Program, machine: str) -> tuple[str, dict[str, Any]]:
        """State and result of one check."""
        try:
            job = {
                "name": program.name,
                "program": self._store.programs.sound_path(program.sha256),
                "lines": program.lines,
                "files": self._store.programs.called(program),
                "state": str(self._store.folder),
                "parent": os.getpid(),
            }
            with self._started() as child:
                timer = threading.Timer(LONGEST_S, child.kill)
                timer.start()
                try:
                    return self._read_result(child, json.dumps(job), program, machine)
                finally:
                    timer.cancel()
                    child.kill()
        except StoreError as error:
            return "failed", {**error.said}
        except OSError as error:
            return "failed", {**message("check_not_started", program=program.name, why=error)}

    def _started(self) -> subprocess.Popen[str]:
        with self._lock:
            self._child = subprocess.Popen(
                self._worker,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
            if self._closed:
                self._child.kill()
            return self._child

    def _read_result(
        self, child: subprocess.Popen[str], job: str, program: Program, machine: str
    ) -> tuple[str, dict[str, Any]]:
        assert child.stdin and child.stdout
        _give(child.stdin, job)
        last_s, told = 0.0, None
        for line in child.stdout:
            answer = json.loads(line)
            if "state" in answer:
                told = str(answer["state"]), dict(answer["result"])
                if not answer.get("more"):
                    return told
                self._keep(program, machine, *told)
            elif time.monotonic() - last_s > TELL_S:
                last_s = time.monotonic()
                self._store.checks.set(program.sha256, machine, "running", float(answer["progress"]))
        if told is not None:
            return told  # what was to come is no part of the check
        return "failed", {**message("check_without_result", program=program.name)}


def _give(stdin: IO[str], job: str) -> None:
    with contextlib.suppress(BrokenPipeError):  # it died; that shows in what it says
        stdin.write(job)
        stdin.close()


# What takes seconds and is asked for now is done in a process of its own, one at a time for each asker, and
# none for long.

DRAFT_WORKER = (sys.executable, "-m", "controller.cli.draft_worker")
LONGEST_DRAFT_S = 20.0
MEASURE_WORKER = (sys.executable, "-m", "controller.cli.measure_worker")
LONGEST_MEASUREMENT_S = 120.0
AT_ONCE = 2  # of different askers


class Errand:
    """A worker that is given a job as JSON, and answers by JSON."""

    def __init__(self, worker: tuple[str, ...], longest_s: float) -> None:
        self._worker, self.longest_s, self._busy = worker, longest_s, set[Owner]()

    async def run(
        self, job: dict[str, Any], busy: Exception, failed: Exception, owner: Owner = NOBODY
    ) -> dict[str, Any]:
        """Raises ``busy`` while it has another of the asker, ``failed`` where it gives no answer in time."""
        if owner in self._busy or len(self._busy) >= AT_ONCE:
            raise busy
        self._busy.add(owner)
        try:
            return await asyncio.wait_for(self._run({**job, "parent": os.getpid()}), self.longest_s)
        except (OSError, ValueError, TimeoutError):
            raise failed from None
        finally:
            self._busy.discard(owner)

    async def _run(self, job: dict[str, Any]) -> dict[str, Any]:
        """The answer of a worker process to a job. Raises OSError and ValueError where it gives none."""
        pipe, nothing = asyncio.subprocess.PIPE, asyncio.subprocess.DEVNULL
        child = await asyncio.create_subprocess_exec(*self._worker, stdin=pipe, stdout=pipe, stderr=nothing)
        try:
            answer, _ = await child.communicate(json.dumps(job).encode())
            found: dict[str, Any] = json.loads(answer)
            return found
        finally:
            if child.returncode is None:
                child.kill()


class Drafts:
    """Programs that are being written are read by the machine's own reader. Nothing is kept."""

    def __init__(self, store: Store, worker: tuple[str, ...] = DRAFT_WORKER) -> None:
        self._store, self._errand = store, Errand(worker, LONGEST_DRAFT_S)

    async def read(self, name: str, text: str, owner: Owner = NOBODY) -> list[dict[str, Any]]:
        """What is refused: line and column (1-based), and the sentence. Raises Refusal."""
        failed = Refusal.of(503, "unread", "draft_unread", name=name)
        try:
            files = await asyncio.to_thread(self._store.programs.called_by, name, text.encode())
        except OSError:
            raise failed from None
        job = {"text": text, "name": name, "files": files, "state": str(self._store.folder)}
        busy = Refusal.of(429, "many", "draft_busy", headers={"Retry-After": "1"})
        found: list[dict[str, Any]] = (await self._errand.run(job, busy, failed, owner))["refusals"]
        return found
