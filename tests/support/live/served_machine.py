"""``directrix serve`` for tests: a process of its own with simulated drives, asked through its door."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from controller import messages
from controller.ipc.control_socket import Client, CommandRefused, control_path
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.service.jobs import UNDER_WAY
from controller.store import history
from controller.store.history import Run

ROOT = Path(__file__).resolve().parents[3]
HANGS_S = 120.0  # no test is meant to come near
POLL_S = 0.02  # two or three ticks; at 5 ms the answers cost twice of what the machine does
SOON_S, LATER_POLL_S = 2.0, 0.05  # what has not come so soon is looked for less often
CALM_S = 0.008  # a period that also a busy computer keeps

Values = dict[str, Any]


def calm(folder: Path) -> tuple[str, str]:
    """Options of ``serving`` for ``calm_machine``."""
    file, text = folder / "calm.toml", (ROOT / "config" / "trunnion.toml").read_text()
    file.write_text(re.sub(r"(?m)^period_s *=.*$", f"period_s = {CALM_S}", text))
    return "--machine", str(file)


def calm_machine() -> Machine:
    """The shipped trunnion at ``CALM_S``."""
    return machine_file.with_period(machine_file.load("trunnion"), CALM_S)


class Serving:
    """A running service."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.state, self.runtime = folder / "state", folder / "run"
        self.log = folder / "serve.log"
        with open(self.log, "ab") as log:
            self.process = subprocess.Popen(
                [
                    *(sys.executable, "-m", "controller", "serve", "--simulate", *options),
                    *("--state", str(self.state), "--runtime", str(self.runtime)),
                ],
                cwd=ROOT,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )
        self.door = Client(control_path(self.runtime))

    def ask(self, verb: str, **args: Any) -> Values:
        return self.door.ask(verb, **args)

    def runs(self) -> list[Run]:
        """Those that it has written, the latest first."""
        with history.reading(self.state) as past:
            return past.runs()

    def refused(self, verb: str, **args: Any) -> CommandRefused:
        """The refusal of what must be refused."""
        try:
            result = self.ask(verb, **args)
        except CommandRefused as error:
            return error
        raise AssertionError(f"{verb} was done: {result}")

    def status(self) -> Values:
        return self.ask("status")

    def until(self, done: Callable[[Values], Any], what: str = "") -> Values:
        """The first status that is ``done``."""
        began_s = time.monotonic()
        give_up_s = began_s + HANGS_S
        while True:
            with contextlib.suppress(CommandRefused):
                now = self.status()
                if done(now):
                    return now
                assert time.monotonic() < give_up_s, f"waited for {what} in vain: {now}"
            assert self.process.poll() is None, self.log.read_text()
            assert time.monotonic() < give_up_s, f"waited for {what} in vain"
            time.sleep(POLL_S if time.monotonic() < began_s + SOON_S else LATER_POLL_S)

    def done(self, verb: str, **args: Any) -> Values:
        """Ask for what takes long, and wait for its end."""
        result = self.ask(verb, **args)
        now = self.until(lambda now: not now["sequence"] or now["sequence"]["state"] != "running", verb)
        assert not now["sequence"] or now["sequence"]["state"] == "done", now["sequence"]
        return result

    def up(self) -> None:
        """Powered up."""
        self.until(lambda now: now["sequence"] and now["sequence"]["state"] == "done", "power up")

    def ready(self) -> None:
        """Powered up, homed and enabled."""
        self.up()
        self.home()

    def home(self) -> None:
        """Homed and enabled."""
        self.done("home")
        self.until(lambda now: now["mode"] == "READY", "READY")

    def put_in(self, tool: int) -> None:
        """The operator puts a tool into the spindle where a program asks for it, and says so."""
        self.load(f"G21\nT{tool} M6\nM30\n", "tool.ngc")
        self.done("start")
        asked = self.until(lambda now: now["tool_change"] or now["mode"] == "READY", "the change")
        if asked["tool_change"]:
            assert asked["tool_change"]["number"] == tool and f"T{tool}" in messages.text(
                asked["tool_change"]
            )
            self.ask("resume")
        assert self.ended()["tool"] == tool

    def load(self, text: str, name: str = "part.ngc") -> None:
        path = self.state / name
        path.write_text(text)
        self.done("load", path=str(path), name=name)

    def ended(self) -> Values:
        """The status when nothing runs any more."""
        return self.until(
            lambda now: (
                (not now["job"] or now["job"]["state"] not in UNDER_WAY)
                and now["mode"] in ("READY", "OFF", "FAULT")
            ),
            "the end",
        )

    def pid(self, role: str) -> int:
        return int(self.ask("facts")["pids"][role])

    def kill(self, role: str, number: int = signal.SIGKILL) -> None:
        os.kill(self.pid(role), number)

    def end(self) -> int:
        """Asked to end, as systemd does."""
        self.door.close()
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        return self.process.wait(HANGS_S)


@contextlib.contextmanager
def serving(folder: Path, *options: str) -> Iterator[Serving]:
    running = Serving(folder, *options)
    try:
        yield running
    finally:
        try:
            running.end()
        finally:
            running.process.kill()
            running.process.wait()
