"""Panels before fake machines, each forked from one Python that has imported all that they need.

    python forked_sites.py      # a line of JSON each way: see ``main``

What a panel imports takes longer than most of what a test asks of it.
"""

from __future__ import annotations

import atexit
import functools
import gc
import importlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

SCRIPTS = ("page_server", "stepped_site")
LOOK_S = 0.01


class Forked:
    """A panel's process, with what of ``subprocess.Popen`` the tests use."""

    def __init__(self, server: Server, pid: int) -> None:
        self.pid = pid
        self._server, self._code = server, None

    def poll(self) -> int | None:
        """Its exit code, or None while it runs."""
        if self._code is None:
            self._code = self._server.ask({"ended": self.pid})
        return self._code

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def wait(self, timeout_s: float) -> int:
        """Its exit code. Raises TimeoutError."""
        give_up_s = time.monotonic() + timeout_s
        while (code := self.poll()) is None:
            if time.monotonic() > give_up_s:
                raise TimeoutError(self.pid)
            time.sleep(LOOK_S)
        return code


class Server:
    """The process that forks."""

    def __init__(self, path: str) -> None:
        """``path``: PYTHONPATH of the panels."""
        self._process = subprocess.Popen(
            [sys.executable, __file__],
            env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, what: Mapping[str, Any]) -> Any:
        assert self._process.stdin is not None and self._process.stdout is not None
        print(json.dumps(what), file=self._process.stdin, flush=True)
        return json.loads(self._process.stdout.readline())

    def begin(self, script: str, folder: Path, port: int, log: Path) -> Forked:
        """A panel of ``support.fakes``, which writes what it says into ``log``."""
        words = {"script": script, "folder": str(folder), "port": port, "log": str(log)}
        return Forked(self, self.ask({**words, "environment": dict(os.environ)}))

    def end(self) -> None:
        """The panels end before it."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


@functools.cache
def server(path: str) -> Server:
    """One for all tests of this process."""
    made = Server(path)
    atexit.register(made.end)
    return made


def main() -> None:
    """Forks and looks as it is asked, until nobody asks any more."""
    mains = {name: importlib.import_module(f"support.fakes.{name}").main for name in SCRIPTS}
    gc.freeze()
    for line in sys.stdin:
        asked = json.loads(line)
        if "ended" in asked:
            pid, status = os.waitpid(asked["ended"], os.WNOHANG)
            answer = os.waitstatus_to_exitcode(status) if pid else None
        elif (answer := os.fork()) == 0:
            _as_its_own(Path(asked["log"]), asked["environment"])
            mains[asked["script"]](Path(asked["folder"]), asked["port"])
            os._exit(0)
        print(json.dumps(answer), flush=True)


def _as_its_own(log: Path, environment: Mapping[str, str]) -> None:
    """A forked process has no share in what is asked and answered."""
    os.environ.clear()
    os.environ.update(environment)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    nothing = os.open(os.devnull, os.O_RDONLY)
    into = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    for found, wanted in ((nothing, 0), (into, 1), (into, 2)):
        os.dup2(found, wanted)


if __name__ == "__main__":
    main()
