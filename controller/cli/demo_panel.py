"""``directrix demo --panel``: a simulated machine with its page, by one command, until Ctrl-C."""

from __future__ import annotations

import contextlib
import json
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

from controller.machine import machine_file, setup_data
from controller.machine.model import TOOL_AT_POWER_ON
from controller.runtime import children
from controller.store import set_up_store, tool_store
from controller.store.service_store import ServiceStore
from controller.verify.console import Refused, say, show, tell

MACHINE = "shop"
PROGRAMS = ("example1_ready", "example2_ready")
ANSWERS_S = 60.0  # for the page to be there
ENDS_S = 30.0  # for both to be gone
Process = subprocess.Popen[bytes]


def run(folder: Path, port: int, period_ms: float, as_json: bool) -> None:
    """Serve until it is interrupted. ``folder`` keeps programs and runs. Raises Refused."""
    _free(port)
    _stock(folder)
    load_magazine(folder)
    with tempfile.TemporaryDirectory(prefix="directrix-") as runtime:  # its socket needs a short path
        where = ("--state", str(folder), "--runtime", runtime)
        commands = (
            ("serve", "--simulate", "--machine", MACHINE, "--period-ms", f"{period_ms:g}", *where),
            ("panel", "--port", str(port), *where),
        )
        with children.CtrlC() as ctrl_c, _started(commands) as processes:
            url = f"http://127.0.0.1:{port}/"
            _await_page(url, processes, ctrl_c)
            if as_json:
                print(json.dumps({"ok": True, "url": url}), flush=True)
            else:
                show.print(say("cli.demo.open", url=url))
            _await_end(processes, ctrl_c)


def _free(port: int) -> None:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            raise Refused(say("cli.demo.port", port=port, why=error)) from error


def _stock(folder: Path) -> None:
    """The paper's two parts, ready to run, where they are not there yet."""
    from controller.cli import panel_users

    with contextlib.closing(panel_users.store_in(folder)) as store:
        known = {program.name for program in store.programs.list()}
        for name in PROGRAMS:
            file = machine_file.shipped_program(name)
            if file.name not in known:
                with store.uploads.begin(file.name, by="demo") as upload:
                    upload.write(file.read_bytes())
                    upload.commit()


def load_magazine(folder: Path) -> None:
    """A simulated changer knows what it holds: nobody could look, and confirm it before anything moves."""
    machine = setup_data.applied(machine_file.load(MACHINE), set_up_store.load(folder))
    assert machine.changer is not None
    with contextlib.closing(ServiceStore(folder)) as kept:
        store = tool_store.ToolStore(kept)
        if not store.known or store.step is not None:
            store.confirm(tool_store.placed(machine.changer.pockets, TOOL_AT_POWER_ON, ()))


@contextlib.contextmanager
def _started(commands: tuple[tuple[str, ...], ...]) -> Iterator[list[Process]]:
    """Both as children; the panel ends first, as it began last."""
    processes: list[Process] = []
    try:
        for command in commands:
            processes.append(subprocess.Popen([sys.executable, "-m", "controller", *command]))
        yield processes
    except KeyboardInterrupt:
        tell.print(say("cli.demo.ending"))
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(ENDS_S)
            process.kill()


def _await_page(url: str, processes: list[Process], ctrl_c: children.CtrlC) -> None:
    give_up_s = time.monotonic() + ANSWERS_S
    while True:
        with contextlib.suppress(OSError), urllib.request.urlopen(url, timeout=ANSWERS_S):
            return
        ctrl_c.look()
        _all_there(processes)
        if time.monotonic() > give_up_s:
            raise Refused(say("cli.demo.no_answer", url=url))
        time.sleep(0.1)


def _await_end(processes: list[Process], ctrl_c: children.CtrlC) -> None:
    while True:
        ctrl_c.look()
        _all_there(processes)
        time.sleep(0.5)


def _all_there(processes: list[Process]) -> None:
    for process, name in zip(processes, ("serve", "panel"), strict=True):
        if (code := process.poll()) is not None:
            raise Refused(say("cli.demo.ended_itself", name=name, code=code))
