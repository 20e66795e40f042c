"""A machine as in a shop, for tests: ``serve --simulate`` and ``panel`` as processes, asked by REST.

Or both of them by one command, ``demo --panel``.

with opened(folder) as shop:
    shop.do("POST", "/machine/home", json={})
    shop.until(lambda now: now["mode"] == "READY", "ready")

Every wait is for something that the machine says; ``HANGS_S`` only ends what hangs. The period is
long by default, so that tests do not depend on a quick computer.
"""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
from support.live.ports import free_port

from controller.cli import demo_panel
from controller.machine.machine_file import SHIPPED

ROOT = Path(__file__).resolve().parents[3]
HANGS_S = 240.0  # no wait is meant to come near
PERIOD_S = 0.01
BY_HAND, DRIVE = 'by = "hand"', "node = 9\ncounts_per_rev = 4096\nacceleration_rev_s2 = 2000.0"
PERIOD = re.compile(r"(?m)^period_s = [0-9.]+")

Values = dict[str, Any]


class Shop:
    """The processes, and a client that holds the control token."""

    def __init__(
        self,
        folder: Path,
        period_s: float,
        commands: tuple[str, ...],
        machine: str = "trunnion",
        part: str = "",
        late: str = "",
    ) -> None:
        self.late = ("--late", late) if late else ()
        self.folder, self.state, self.runtime = folder, folder / "state", folder / "run"
        self.machine_file = folder / "machine.toml"
        self.machine_file.write_text(machine if "\n" in machine else text_of(machine, period_s))
        self.part: tuple[str, ...] = ()
        if part:
            (folder / "part.toml").write_text(part)
            self.part = ("--part", str(folder / "part.toml"))
        if machine == demo_panel.MACHINE:
            self.state.mkdir()
            demo_panel.load_magazine(self.state)
        self.tools_put_in = 0
        self.port = free_port()
        self.processes = {name: self._begin(name) for name in commands}
        self.url = f"http://127.0.0.1:{self.port}"
        self.http = httpx.Client(base_url=f"{self.url}/api/v1", timeout=HANGS_S)

    def _begin(self, name: str) -> subprocess.Popen[bytes]:
        port = ("--port", str(self.port))
        where = ("--state", str(self.state), "--runtime", str(self.runtime))
        words = {
            "serve": ("--simulate", *self.late, "--machine", str(self.machine_file), *self.part, *where),
            "panel": (*port, *where),
            "demo": ("--panel", "--out", str(self.state), *port),
        }
        with open(self.folder / f"{name}.log", "ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", "controller", name, *words[name]],
                cwd=ROOT,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    def kill(self, name: str) -> None:
        """SIGKILL, and started anew as systemd does."""
        self.processes[name].kill()
        self.processes[name].wait()
        self.processes[name] = self._begin(name)

    def logs(self) -> str:
        return "\n".join(file.read_text() for file in sorted(self.folder.glob("*.log")))

    def do(self, method: str, path: str, **more: Any) -> Any:
        """What is answered to what must be done; what takes long is waited for."""
        answer = self.http.request(method, path, **more)
        assert answer.is_success, (method, path, answer.text)
        said = answer.json() if answer.content else None
        result = said.get("result") if isinstance(said, dict) else None
        if isinstance(result, dict) and result.get("done") is False:
            now = self.until(lambda now: (now["sequence"] or {}).get("state") != "running", path)
            assert now["sequence"]["state"] == "done", now["sequence"]
        return said

    def refused(self, method: str, path: str, status: int, **more: Any) -> Values:
        """The error of what must be refused."""
        answer = self.http.request(method, path, **more)
        assert answer.status_code == status, (method, path, answer.status_code, answer.text)
        found: Values = answer.json()["error"]
        return found

    def status(self) -> Values:
        found: Values = self.http.get("/status").raise_for_status().json()
        return found

    def until(self, holds: Callable[[Values], Any], what: str) -> Values:
        """The first status that ``holds``."""
        give_up_s, now = time.monotonic() + HANGS_S, {}
        while time.monotonic() < give_up_s:
            with contextlib.suppress(httpx.TransportError, httpx.HTTPStatusError):
                now = self.status()
                if holds(now):
                    return now
            ended = [name for name, process in self.processes.items() if process.poll() is not None]
            assert not ended, (what, ended, self.logs())
            time.sleep(0.05)
        raise AssertionError(f"waited for {what} in vain: {now}\n{self.logs()}")

    def up(self) -> None:
        """Powered up, and the control token is ours."""
        self.until(lambda now: (now.get("sequence") or {}).get("state") == "done", "power up")
        self.take_control()

    def take_control(self) -> None:
        self.http.headers["X-Control-Token"] = self.do("POST", "/control", json={"take_over": True})["token"]

    def ready(self) -> None:
        """Homed and enabled."""
        self.up()
        self.do("POST", "/machine/home", json={})
        self.do("POST", "/machine/enable")
        self.until(lambda now: now["mode"] == "READY", "READY")

    def put_in(self, tool: int) -> None:
        """A changer fetches a tool, or the operator puts it in where a program asks for it, and says so."""
        self.upload("tool.ngc", f"G21\nT{tool} M6\nM30\n".encode())
        self.do("POST", "/job", json={"program": "tool.ngc"})
        self.do("POST", "/cycle/start")
        if self.status()["changer"] is None:
            asked = self.until(lambda now: now["tool_change"], "the change")["tool_change"]
            assert asked["number"] == tool and f"T{tool}" in asked["sentence"]
            self.do("POST", "/cycle/resume")
        self.until(lambda now: now["mode"] == "READY" and now["tool"] == tool, "the tool")
        self.run_record()
        self.tools_put_in += 1

    def move_slowly(self) -> None:
        """For longer than anything that is measured meanwhile: at rest less is told."""
        self.upload("slow.ngc", b"G21 G90\nG1 X200 F60\nM30\n")
        self.do("POST", "/job", json={"program": "slow.ngc"})
        self.do("POST", "/cycle/start")
        self.until(lambda now: now["mode"] == "RUNNING", "RUNNING")

    def upload(self, name: str, text: bytes) -> Values:
        """Stored, and its check has ended."""
        self.do("POST", "/programs", files={"file": (name, text)})
        give_up_s = time.monotonic() + HANGS_S
        while (check := self.do("GET", f"/programs/{name}/check"))["state"] in ("none", "waiting", "running"):
            assert time.monotonic() < give_up_s, check
            time.sleep(0.1)
        assert check["state"] == "passed", check
        found: Values = check["result"]
        return found

    def run_record(self, number: int = 0) -> Values:
        """The facts of a run once its record is written; 0 = the newest. Putting a tool in was one, too."""
        give_up_s = time.monotonic() + HANGS_S
        while len(runs := self.do("GET", "/runs")["runs"]) <= number + self.tools_put_in:
            assert time.monotonic() < give_up_s, self.logs()
            time.sleep(0.1)
        found: Values = self.do("GET", f"/runs/{runs[number]['id']}")
        return found

    def end(self) -> None:
        self.http.close()
        for process in reversed(self.processes.values()):
            process.terminate()
        for process in self.processes.values():
            try:
                process.wait(60.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@contextlib.contextmanager
def opened(
    folder: Path,
    period_s: float = PERIOD_S,
    commands: tuple[str, ...] = ("serve", "panel"),
    machine: str = "trunnion",
    part: str = "",
    late: str = "",
) -> Iterator[Shop]:
    """A shop until the block ends; ``folder`` is empty. A ``demo`` has its own machine and period.

    ``machine``: a shipped one, which gets that period, or the text of a machine file.
    ``part``: a simulation file's text, of what a probe can touch; without one the usual block.
    ``late``: "stop" for a machine whose late ticks are not only counted, which has a pump.
    """
    shop = Shop(folder, period_s, commands, machine, part, late)
    try:
        yield shop
    finally:
        shop.end()


def text_of(name: str, period_s: float = PERIOD_S) -> str:
    """A shipped machine at another period."""
    text = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
    changed, count = PERIOD.subn(f"period_s = {period_s}", text)
    assert count == 1
    return changed


def driven(name: str = "trunnion", period_s: float = PERIOD_S) -> str:
    """The same with a drive for its spindle: nobody stands beside it who would switch one."""
    return text_of(name, period_s).replace(BY_HAND, DRIVE)
