"""A state folder as service and panel left it when the net was made, and what they find in it now.

The service was killed in a program that it held, the panel has users, a program, a queue: whatever is rebuilt
opens it, goes on with the run, and loses nothing.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import signal
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from support.fakes.fake_engine import served
from support.fakes.written_history import WrittenHistory
from support.live.served_machine import serving
from support.machines.interrupted_runs import fresh, rest_of, resumed
from support.net import normal

from controller.api.store import Store
from controller.ipc.handoff import COLUMN
from controller.machine import machine_file
from controller.plan.restart.program_position import Spot
from controller.service import restart_preview
from controller.service.command_handlers import CommandHandlers
from controller.service.service import Service
from controller.store import history

ARCHIVE = "state.tar.xz"
LINE = 9  # it was held here
PROGRAM = """G21 G90 G54 T2 M6
G43.4
G0 X0 Y0 Z60. A0 C0
G1 Z40. F3000.
G1 X30. Y8. A6.
G1 X-10. A2.
G4 P0.3
G1 X20. Y0. F900.
G1 X-25. A5. F600.
G1 X0. A0.
G49
G0 Z120.
M30
"""
VALUES = {"name": "end mill 3 mm", "radius_mm": 1.48, "flute_mm": 14.0, "length_mm": 42.0}
OFFSET = [8.0, 96.0, 131.0]
LEFT_OUT = ("checks", "pictures", "recordings")  # figures that are made again where they are missing
FACTS = ("name", "line", "fraction", "exact", "done", "tool", "mode", "fault", "dry_run_mm", "offered", "key")


def make(folder: Path) -> None:
    """Serve a machine, hold a program, kill all; and put into the panel's store some of everything."""
    with tempfile.TemporaryDirectory(prefix="state-") as scratch:
        with serving(Path(scratch), "--machine", "trunnion", "--period-ms", "8") as service:
            service.ready()
            service.ask("set_offset", name="G55", values=OFFSET)
            service.ask("set_tool", number=2, **VALUES)
            service.ask("tool_life", tool=2, cut_min=30.0)
            service.ask("maintenance", name="oil", counter="spindle", every=100.0)
            service.put_in(2)
            service.load(PROGRAM)
            service.done("start")
            service.until(lambda now: now["job"]["line"] >= LINE and now["mode"] == "RUNNING")
            service.ask("hold")
            service.until(lambda now: now["mode"] == "HOLD" and now["at_rest"])
            pids = [service.pid("tick"), service.pid("plan"), service.process.pid]
            for pid in reversed(pids):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        state = Path(scratch) / "state"
        _panel(state)
        _pack(state, folder / ARCHIVE)


def _panel(state: Path) -> None:
    store = Store(state)
    with store.uploads.begin("part.ngc", by="anna") as upload:
        upload.write(PROGRAM.encode())
        upload.commit()
    store.users.set("anna", "$argon2id$v=19$m=8,t=1,p=1$c2FsdHNhbHQ$7Yf5RmtzYzcxbG8wMDAwMA", "set_up")
    store.users.set("otto", "$argon2id$v=19$m=8,t=1,p=1$c2FsdHNhbHQ$7Yf5RmtzYzcxbG8wMDAwMA", "view")
    store.users.add_token("0" * 64, "cell", "operate", "anna")
    store.queue.add("part.ngc", 3, "anna")
    store.settings.set("language", "de", "anna")
    store.audit.add("anna", "127.0.0.1", "load", "part.ngc")
    WrittenHistory(state).run("part.ngc", "completed")
    store.close()


def _pack(state: Path, archive: Path) -> None:
    """Without what is made again, and the same from the same files."""

    def plain(info: tarfile.TarInfo) -> tarfile.TarInfo | None:
        parts = Path(info.name).parts
        if len(parts) > 1 and parts[1] in LEFT_OUT and not info.isdir():
            return None
        info.uid = info.gid = 0
        info.uname = info.gname = ""
        return info

    with tarfile.open(archive, "w:xz", preset=9) as packed:
        packed.add(state, "state", filter=plain)


@contextlib.contextmanager
def unpacked(folder: Path) -> Iterator[Path]:
    """The folder that has "state" in it."""
    with tempfile.TemporaryDirectory(prefix="state-") as scratch:
        with tarfile.open(fileobj=io.BytesIO((folder / ARCHIVE).read_bytes())) as packed:
            packed.extractall(scratch, filter="data")
        yield Path(scratch)


def text(folder: Path) -> str:
    """What a service and a panel of now find in it, and the files that there are then."""
    with unpacked(folder) as scratch:
        rows = [*_of_service(scratch), *_of_panel(scratch / "state")]
        rows += [f"file {name}" for name in layout(scratch / "state")]
    return "".join(f"{row}\n" for row in rows)


def _of_service(scratch: Path) -> Iterator[str]:
    (written,) = (scratch / "state").glob("runs/*-part.ngc/machine.toml")  # the shipped one may have changed
    service = served(scratch, machine_file.read(written.read_text(), "trunnion.toml"))
    desk = CommandHandlers(service)
    try:
        offered = restart_preview.restart(service)
        yield from normal.lines({key: offered[key] for key in FACTS}, "restart")
        path = str(scratch / "state" / "part.ngc")
        job = restart_preview.gone_on_with(service, {"path": path, "name": "part.ngc"})
        assert job.program.spot is not None
        yield from normal.lines(job.program.spot._asdict(), "spot")
        yield from normal.lines(job.fitted, "fitted")
        yield from normal.lines(_rest(service, job.program.spot, job.program.machine), "rest")
        with history.reading(service.state) as past:
            for run in past.runs():
                yield from normal.lines({"result": run.result, "name": run.program}, "run")
        for alarm in service.alarms.list():
            yield from normal.lines({"name": alarm["name"]}, "alarm")
        used = service.usage.to_json()
        yield from normal.lines([[one["number"], one["worn"]] for one in used["tools"]], "usage")
        yield from normal.lines([one["name"] for one in used["items"]], "maintenance")
    finally:
        desk.close()
        service.close()


def _rest(service: Service, spot: Spot, machine: Any) -> dict[str, Any]:
    """It is gone on with, to its end."""
    done = resumed(fresh(machine), rest_of(PROGRAM, spot, machine), in_spindle=2)
    cut = [int(line) for line in np.unique(done.run.rows[:, COLUMN["line"]]) if line > 0]
    return {"result": done.run.result, "lines": cut}


def _of_panel(state: Path) -> Iterator[str]:
    store = Store(state)
    try:
        found = {
            "programs": [[one.name, one.sha256, one.size] for one in store.programs.list()],
            "users": [[one.name, one.role] for one in store.users.all()],
            "tokens": [[one.name, one.role] for one in store.users.tokens()],
            "queue": [[one.program, one.count] for one in store.queue.all()],
            "settings": store.settings.all(),
            "audit": [[one.user, one.action, one.detail] for one in store.audit.list()],
        }
        yield from normal.lines(found, "store")
    finally:
        store.close()


def layout(state: Path) -> list[str]:
    """Files by their names, dates and hashes as N."""
    names = {str(file.relative_to(state)) for file in state.rglob("*") if file.is_file()}
    return sorted({re.sub(r"\b[0-9a-f]{12,}\b|\d+", "N", re.sub(r"-(wal|shm)$", "", name)) for name in names})
