"""A running machine that is brought up, over REST: what moves it are programs of its store."""

from __future__ import annotations

import contextlib
import csv
import io
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from controller.bringup.ticks import NotDone, Stop, Ticks
from controller.cli import waiting
from controller.cli.client import carried_out, load_program
from controller.cli.client_lists import check_refusal, upload_file, wait_for_check
from controller.cli.remote import Machine as Remote
from controller.geometry.arrays import Array
from controller.machine.model import Machine
from controller.messages import message
from controller.state.modes import Mode
from controller.state.setpoints import commanded
from controller.verify.console import Refused, say

POLL_S = 0.5  # between two looks at the ticks, of which the panel keeps half a minute
SEEN_S, SHORTEST_S = 10.0, 0.05  # within which drives must be on or off, and between two looks
REST_S = 0.3  # after a motion, until its last position has come


class LiveBench:
    """The machine behind a panel, whose control token is held. Raises Refused where it is another one."""

    def __init__(self, remote: Remote, machine: Machine) -> None:
        self.machine, self._remote = machine, remote
        found = str(remote.get("machine/file")["name"])
        if found != machine.name:
            raise Refused(say("bringup.other_machine", found=found, machine=machine.name))
        signals = [f"{axis.name}.{which}" for which in ("setpoint", "actual") for axis in machine.axes]
        self._names = [*signals, "line", "mode"]

    def positions(self) -> tuple[float, ...]:
        joints = self._remote.get("status")["joints"]
        return tuple(float(joints[axis.name]["actual"]) for axis in self.machine.axes)

    def run(self, text: str, name: str, dry_run_mm: float = 0.0) -> Ticks:
        try:
            return self._run(text, f"bring_up_{Path(name).stem}.ngc", dry_run_mm)
        except Refused as refused:
            raise NotDone(message("text", text=str(refused))) from refused

    def _run(self, text: str, name: str, dry_run_mm: float) -> Ticks:
        """Raises Refused."""
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / name
            file.write_text(text, encoding="utf-8")
            upload_file(self._remote, file, name)
        facts = wait_for_check(self._remote, name, quiet=True)
        if facts["check"]["state"] in ("refused", "failed"):
            raise Refused(check_refusal(name, facts["check"]["result"]))
        load_program(self._remote, {"program": name, **({"dry_run_mm": dry_run_mm} if dry_run_mm else {})})
        begin = self._newest()
        run = waiting.run_of(self._remote, carried_out(self._remote, "cycle/start"))
        ended: dict[str, Any] = {}

        def has_ended() -> bool:
            found, _ = waiting.outcome_and_status(self._remote, run)
            ended.update(found or {})
            return bool(ended.get("result"))

        rows = self._recorded(begin, has_ended)
        with contextlib.suppress(Refused):  # so that the next one may have its name
            self._remote.delete("job")
        if ended["result"] != waiting.COMPLETED:
            raise Refused(str(ended["sentence"] or ended["result"]))
        return self._ticks(rows)

    def _recorded(self, after: int, done: Callable[[], bool]) -> Array:
        """Every tick after that one, until it is done."""
        parts, over = [self._ticks_after(after)], False
        while not over:
            over = done()
            time.sleep(REST_S if over else POLL_S)
            parts.append(self._ticks_after(int(parts[-1][-1, 0]) if len(parts[-1]) else after))
        rows = np.concatenate(parts)
        if (np.diff(rows[:, 0]) != 1.0).any():
            raise NotDone(message("bringup.ticks_lost"))
        return rows

    def _ticks(self, rows: Array) -> Ticks:
        axes = len(self.machine.axes)
        shown = [axis.shown_per_unit for axis in self.machine.axes]
        return Ticks(
            self.machine.period_s,
            int(self._remote.get("status")["tick"]["latency"]),
            commanded(rows[:, 1 : 1 + axes], self.machine) * shown,
            rows[:, 1 + axes : 1 + 2 * axes],
            rows[:, -2].astype(np.int64),
            rows[:, -1] == Mode.HOLD,
        )

    def _newest(self) -> int:
        return int(self._remote.get("ticks/signals")["newest"] or 0)

    def _ticks_after(self, tick: int) -> Array:
        """Tick, setpoints, positions and line, shape (N, 2 + 2 axes)."""
        text = self._remote.get("ticks/export.csv", names=",".join(self._names), first=tick + 1)
        rows = list(csv.reader(io.StringIO(text)))[1:]
        columns = [0, *range(2, 2 + len(self._names))]  # without the time
        table = [[float(row[i] or "nan") for i in columns] for row in rows if row]
        return np.array(table, dtype=np.float64).reshape(-1, len(columns))

    def switched_off(self, seconds: float) -> Ticks:
        begin = self._newest()
        until_s = time.monotonic() + seconds
        self.power(False)
        rows = self._recorded(begin, lambda: time.monotonic() > until_s)
        self.power(True)
        return self._ticks(rows)

    def power(self, on: bool) -> None:
        self._do("machine/enable" if on else "machine/disable")
        until_s = time.monotonic() + SEEN_S
        while self._remote.get("status")["mode"] != ("READY" if on else "OFF"):
            if time.monotonic() > until_s:
                raise NotDone(message("bringup.mode", mode=self._remote.get("status")["mode"]))
            time.sleep(SHORTEST_S)

    def wait(self, seconds: float) -> None:
        time.sleep(seconds)

    def by_hand(self, action: str) -> bool:
        return False

    def inputs(self) -> dict[str, bool]:
        found: dict[str, bool] = self._remote.get("status")["inputs"] or {}
        return found

    def switches(self, axis: str) -> int | None:
        try:
            word = self._remote.get(f"drives/{axis}/terminals")["word"]
        except Refused as refused:
            raise NotDone(message("text", text=str(refused))) from refused
        return None if word is None else int(word)

    def clamp(self, axis: str, is_open: bool) -> None:
        try:
            self._remote.put("machine/clamps", {"open": [axis] if is_open else []})
        except Refused as refused:
            raise NotDone(message("text", text=str(refused))) from refused

    def tool(self) -> int:
        return int(self._remote.get("status")["tool"] or 0)

    def touches(self) -> str:
        return str(self._remote.get("probing/touches.csv"))

    def stopped_by(self) -> Stop | None:
        fault = self._remote.get("status").get("fault")
        if fault is None:
            return None
        return Stop(str(fault.get("axis") or ""), message("text", text=str(fault["sentence"])))

    def recover(self) -> None:
        for path in ("machine/reset", "machine/home", "machine/enable"):
            self._do(path)

    def _do(self, path: str) -> None:
        """Raises NotDone."""
        try:
            carried_out(self._remote, path, {} if path.endswith("home") else None)
        except Refused as refused:
            raise NotDone(message("text", text=str(refused))) from refused
