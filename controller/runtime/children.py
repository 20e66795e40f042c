"""The processes of a live machine as its parent holds them: started, asked how they are, ended; and how each
of them begins.

They are fresh interpreters and no forks, so that nothing of the parent (its terminal, its
threads, its open files) reaches into a process that has a deadline. Each is a process
group of its own, for Ctrl-C is the parent's alone, and is asked to end when the parent dies,
whatever it dies of.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import pickle
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controller import one_thread
from controller.ipc import internal_error
from controller.machine.model import Machine
from controller.messages import message, text

END_S = 5.0  # to stand down; then it is killed

_PR_SET_PDEATHSIG = 1
_STDERR = 2


@dataclass(frozen=True, slots=True)
class Job:
    """What the tick's process is given: its end of each socket (descriptors), and where shared memory is."""

    machine: Machine
    pieces: int
    requests: int
    snapshot_path: str
    recorder_path: str
    inverter: tuple[str, str] | None = None  # of the slot of one on a serial line


def environment() -> dict[str, str]:
    """Of a fresh interpreter that is to find what we find."""
    path = os.pathsep.join(map(os.path.abspath, sys.path))
    return {**os.environ, **one_thread.ENVIRONMENT, "PYTHONPATH": path}


class Child:
    """A running process."""

    def __init__(
        self,
        role: str,
        arguments: Sequence[str],
        words: Path,
        descriptors: Sequence[int] = (),
    ) -> None:
        """``words``: the file in which the process would leave a sentence about its end."""
        self.role = role
        self._words = words
        self.process = subprocess.Popen(
            # -P: a folder of the user's that happens to be named like one of ours is not ours.
            [sys.executable, "-P", "-m", "controller.runtime", role, str(os.getpid()), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=_STDERR,  # standard output is the command's own
            pass_fds=descriptors,
            env=environment(),
            process_group=0,
        )

    @property
    def pid(self) -> int:
        return self.process.pid

    def is_alive(self) -> bool:
        return self.process.poll() is None

    def last_words(self) -> str:
        """The sentence it left, or how it ended; empty while it runs and when it was asked to end."""
        with contextlib.suppress(OSError):
            return self._words.read_text()
        code = self.process.poll()
        if code is not None and code < 0:
            return text(message("process.killed", role=self.role, signal=signal.Signals(-code).name))
        return text(message("process.ended", role=self.role, code=code)) if code else ""

    def end(self) -> None:
        """Ask it to end; kill it if it does not. Raises TimeoutExpired then."""
        end(self.process, END_S)


def end(process: subprocess.Popen[bytes], patience_s: float) -> None:
    """Ask a process to end; kill it if it does not. Raises TimeoutExpired then."""
    for number in (signal.SIGTERM, signal.SIGCONT):  # a stopped process hears nothing
        process.send_signal(number)
    try:
        process.wait(patience_s)
    finally:
        process.kill()
        process.wait()


def start(
    role: str,
    job: object,
    folder: Path,
    descriptors: Sequence[int] = (),
    name: str = "",
) -> Child:
    """Start the process of a role on its job; ``folder`` holds what it is given and says.

    ``name``: of its files, where there are several of that role.
    """
    file = folder / f"{name or role}.job"
    file.write_bytes(pickle.dumps(job))
    words_of(file).unlink(missing_ok=True)  # of the one before it
    return Child(role, [str(file)], words_of(file), descriptors)


def words_of(job_file: Path) -> Path:
    """Where a process leaves its last words."""
    return job_file.with_suffix(".words")


class CtrlC:
    """Ctrl-C, and SIGTERM as if it were: what was made is to be cleared away.

    KeyboardInterrupt as usual; but Python drops what comes up while an object ends or a callback of the
    import machinery runs, so ``look`` raises it again.
    """

    def __init__(self) -> None:
        self._pressed = False

    def __enter__(self) -> CtrlC:
        self._before = [(one, signal.signal(one, self._hear)) for one in (signal.SIGINT, signal.SIGTERM)]
        return self

    def __exit__(self, *_: object) -> None:
        for number, before in self._before:
            signal.signal(number, before)

    def look(self) -> None:
        """Raises KeyboardInterrupt where it was pressed."""
        if self._pressed:
            raise KeyboardInterrupt

    def _hear(self, *_: object) -> None:
        self._pressed = True
        raise KeyboardInterrupt


# -- called in the process


def run(role: str, main: Callable[[Any], None], job_file: Path, expected: tuple[type[Exception], ...]) -> int:
    """Carries out a job; the exit code. Whatever ends it too early is one sentence beside the job.

    ``expected``: what has a sentence for the operator; all else is a mistake of ours.
    """
    try:
        main(pickle.loads(job_file.read_bytes()))
    except expected as error:
        words_of(job_file).write_text(str(error))
    except Exception as error:  # the top of a process: its parent tells the operator
        words_of(job_file).write_text(own_error(role, error))
    else:
        return 0
    return 1


def own_error(role: str, error: Exception) -> str:
    """A mistake of ours in one sentence, with its place."""
    return text(message("process.own_error", role=role, error=internal_error.summary(error)))


class EndRequest:
    """Becomes true when this process is asked to end."""

    def __init__(self) -> None:
        self.yes = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._hear)

    def _hear(self, _number: int, _frame: object) -> None:
        self.yes = True


def end_with(parent: int) -> None:
    """SIGTERM for us when ``parent`` is gone."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
    if os.getppid() != parent:
        sys.exit(1)  # it was gone before we could ask


def joined(descriptor: int, kind: socket.SocketKind) -> socket.socket:
    """The non-blocking socket that was handed over as ``descriptor``."""
    handed = socket.socket(socket.AF_UNIX, kind, fileno=descriptor)
    handed.setblocking(False)
    return handed
