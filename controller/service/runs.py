"""Records of runs: what was run, how it went, and every setpoint, so that it can be run again.

A folder per run in the state folder:

    runs/2026-11-21T083120.042-part.ngc/
        begun.json       what and when, while it is under way
        run.json         the same with result, duration, cut time, largest following errors
        events.jsonl     the operator's requests by tick, as ``simulate --events`` reads them
        setpoints.npz    tick and the five setpoints of every tick (int32)
        setpoints.part   the same rows as they came, instead of it, where nobody lived to write the end

Ticks count from cycle start, and those alone that sent a SYNC: the path clock counts no others.
Which tick took a request is read from the recorder's rows, where the change shows, and not from
a clock. What the planner made of an override depends on when it looked, so its turns are
events, too: "plan" says before which tick it acted, "pieces" before which its message was taken.
The first line, "begin", says from where, and with which tools and offsets.
"""

from __future__ import annotations

import contextlib
import json
import re
import shutil
import time
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from controller import whole
from controller.handoff import COLUMN, STOOD
from controller.journal import sha256
from controller.machine import Machine
from controller.service.orders import Program, Turn
from controller.session.recording import forget_oldest, new_folder
from controller.session.starts import Start
from controller.state import Mode

FOLDER, RUN, BEGUN = "runs", "run.json", "begun.json"
KEPT = 200
LAG_TICKS = 2  # from a setpoint to the feedback that can have followed it
SETPOINTS = ("tick", *(f"setpoint_{i}" for i in range(5)))
MOST_BYTES = 256 << 20  # of setpoints in one run: six hours at 2 ms

Rows = npt.NDArray[np.float64]

_TAKEN = [COLUMN[name] for name in SETPOINTS]
_COMMAND, _ACTUAL = COLUMN["joint_command_0"], COLUMN["actual_0"]
_SWITCHES = {1: "single_block", 2: "optional_stop"}


class RunRecord:
    """One run while it is under way. ``rows`` are those of the recorder since the start was asked for."""

    def __init__(self, state: Path, machine: Machine, what: dict[str, Any]) -> None:
        """``what`` is kept as it is. A full disk costs the record, not the run: ``problem`` says why."""
        self.machine, self.what = machine, what
        self.began = False  # the tick has taken the start
        self.stopped = False  # by an operator
        self.first_tick = -1
        self.last_tick = -1
        self.holds_asked = 0  # of the operator, not yet seen in the rows
        self._cut_ticks = 0
        self._errors = np.zeros(5)
        self._before: Rows | None = None
        self._commands = np.zeros((0, 5))
        self._events: list[dict[str, Any]] = []
        self._turns: list[Turn] = []
        self._sent: list[npt.NDArray[np.int64]] = []  # ticks that sent a SYNC, since the start
        self._taken: list[npt.NDArray[np.int64]] = []  # ticks that took a message of the plan
        self._start: dict[str, Any] | None = None
        self._started_s = time.time()
        self._kept_bytes = 0
        self._ticks = 0  # that sent a SYNC
        self._busy = (0, -1)  # how many of them belong to the run, and the last tick of it
        self.problem = ""
        self.folder = state / FOLDER / _stem(str(what.get("name", "")))
        self._file: BinaryIO | None = None
        try:
            self.folder = new_folder(self.folder.parent, self.folder.name)
            self._file = open(self.folder / "setpoints.part", "wb")  # noqa: SIM115
        except OSError as error:
            self.problem = error.strerror or str(error)

    # -- while it runs

    def take(self, rows: Rows) -> None:
        """The next rows of the recorder."""
        ticks = rows[:, COLUMN["tick"]].astype(np.int64)
        self._taken.append(ticks[rows[:, COLUMN["accepted"]] != 0.0])
        if not self.began:
            going = np.flatnonzero(
                (rows[:, COLUMN["mode"]] == Mode.RUNNING) | (rows[:, COLUMN["rate"]] > 0.0)
            )
            if not len(going):
                self._before = rows[-1] if len(rows) else self._before
                return
            self.began = True
            self.first_tick = int(rows[going[0], COLUMN["tick"]])
            self._before = rows[going[0] - 1] if going[0] else self._before
            self._first_settings(rows[going[0]])
            rows = rows[going[0] :]
        if len(rows):
            self._measure(rows)
            self._find_events(rows)
            self._keep(rows)
            self.last_tick, self._before = int(rows[-1, COLUMN["tick"]]), rows[-1]

    def begins(self, start: Start, program: Program, fitted: dict[str, Any]) -> None:
        """From where, and on what: without it nothing could be run again but a start after homing.

        From here on the disk knows of the run, so that it is told even if nobody lives to end it.
        """
        sums = {
            "program_sha256": sha256(program.text),
            "machine_sha256": sha256(program.machine.text.encode()),
        }
        self._start = {**start.to_dict(), "fitted": fitted, **sums}
        with contextlib.suppress(OSError):
            _write_facts(self.folder / BEGUN, self._facts())
            whole.sync(self.folder.parent)

    def led_aside(self) -> None:
        """The tool was led off the path, where an operator may jog it: that is not run again."""
        self._events.append({"at": max(self.last_tick, self.first_tick), "request": "aside"})

    def planned(self, turns: tuple[Turn, ...]) -> None:
        """When the planner acted, and on which tick's snapshot."""
        self._turns += turns

    def _first_settings(self, row: Rows) -> None:
        """Overrides and switches that were set before the start hold from its first tick on."""
        for name in ("override", "rapid_override"):
            if row[COLUMN[name]] != 1.0:
                self._event(row, name, round(100.0 * float(row[COLUMN[name]]), 9))
        for bit, name in _SWITCHES.items():
            if int(row[COLUMN["switches"]]) & bit:
                self._event(row, name, 1)

    def _measure(self, rows: Rows) -> None:
        cutting = (rows[:, COLUMN["cutting"]] != 0.0) & (rows[:, COLUMN["rate"]] > 0.0)
        self._cut_ticks += int(np.count_nonzero(cutting & (rows[:, COLUMN["sync_sent"]] != 0.0)))
        commands = np.concatenate([self._commands, rows[:, _COMMAND : _COMMAND + 5]])
        actual = rows[max(0, LAG_TICKS - len(self._commands)) :, _ACTUAL : _ACTUAL + 5]
        if len(actual):
            lag = np.abs(commands[: len(commands) - LAG_TICKS][-len(actual) :] - actual)
            self._errors = np.maximum(self._errors, lag.max(axis=0))
        self._commands = commands[-LAG_TICKS:]

    def _find_events(self, rows: Rows) -> None:
        """Where a column of the operator's changes, its request has been taken in that tick."""
        before = rows[:1] if self._before is None else self._before[None, :]
        all_rows = np.concatenate([before, rows])
        columns = [COLUMN[name] for name in ("mode", "override", "rapid_override", "switches")]
        changed = np.flatnonzero((np.diff(all_rows[:, columns], axis=0) != 0.0).any(axis=1))
        for i in changed:
            if int(all_rows[i + 1, COLUMN["tick"]]) > self.first_tick:
                self._changes(all_rows[i], all_rows[i + 1])

    def _changes(self, old: Rows, new: Rows) -> None:
        modes = Mode(int(old[COLUMN["mode"]])), Mode(int(new[COLUMN["mode"]]))
        for name in ("override", "rapid_override"):
            if old[COLUMN[name]] != new[COLUMN[name]]:
                self._event(new, name, round(100.0 * float(new[COLUMN[name]]), 9))
        flipped = int(old[COLUMN["switches"]]) ^ int(new[COLUMN["switches"]])
        for bit, name in _SWITCHES.items():
            if flipped & bit:
                self._event(new, name, int(bool(int(new[COLUMN["switches"]]) & bit)))
        if int(new[COLUMN["switches"]]) & STOOD:
            self._event(new, "stand")
        if modes == (Mode.RUNNING, Mode.HOLD) and self.holds_asked:
            self.holds_asked = 0
            self._event(new, "hold")
        elif modes == (Mode.HOLD, Mode.RUNNING):
            self._event(new, "resume")
        elif modes[1] is Mode.STOPPING and modes[0] is not Mode.STOPPING:
            self.stopped = True
            self._event(new, "stop")

    def _event(self, row: Rows, request: str, value: float | None = None) -> None:
        event = {"at": int(row[COLUMN["tick"]]), "request": request}
        self._events.append(event if value is None else {**event, "value": value})

    def _keep(self, rows: Rows) -> None:
        """A full disk costs the record, not the run."""
        sent = rows[rows[:, COLUMN["sync_sent"]] != 0.0]
        taken = sent[:, _TAKEN].copy()
        self._sent.append(sent[:, COLUMN["tick"]].astype(np.int64))
        taken[:, 0] = np.arange(self._ticks, self._ticks + len(sent))
        busy = np.flatnonzero(sent[:, COLUMN["mode"]] != Mode.READY)
        if len(busy):  # what stands behind the end is only the looking whether it stands
            last = min(int(busy[-1]) + 1, len(sent) - 1)
            self._busy = (self._ticks + int(busy[-1]) + 2, int(sent[last, COLUMN["tick"]]))
        self._ticks += len(sent)
        if self._file is None or self._kept_bytes > MOST_BYTES:
            return
        data = taken.astype("<i4").tobytes()
        try:
            self._file.write(data)
            self._kept_bytes += len(data)
        except OSError:
            self._file = None

    # -- at its end

    def end(self, result: str, **more: Any) -> dict[str, Any]:
        """Write the record; its facts."""
        ticks, last_tick = min(self._busy[0], self._ticks), self._busy[1]
        passed = last_tick - self.first_tick + 1 if self.began and ticks else 0
        shown = [
            float(e * abs(a.shown_per_unit)) for e, a in zip(self._errors, self.machine.axes, strict=True)
        ]
        facts = {
            **self._facts(),
            "ended_s": time.time(),
            "result": result,
            "duration_s": passed * self.machine.period_s,
            "ticks": ticks,
            "skips": max(0, passed - ticks),
            "first_tick": self.first_tick,
            "cut_time_s": self._cut_ticks * self.machine.period_s,
            "following_error": {a.name: e for a, e in zip(self.machine.axes, shown, strict=True)},
            **more,
        }
        with contextlib.suppress(OSError):
            self._write(facts)
        return facts

    def _facts(self) -> dict[str, Any]:
        """What is known from the beginning."""
        return {"id": self.folder.name, **self.what, "started_s": self._started_s}

    def throw_away(self) -> None:
        """Nothing was run."""
        if self._file is not None:
            self._file.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _write(self, facts: dict[str, Any]) -> None:
        events = self._timed()
        self.folder.mkdir(parents=True, exist_ok=True)  # there may be room by now
        (self.folder / "events.jsonl").write_text("".join(json.dumps(event) + "\n" for event in events))
        if self._file is not None:
            self._file.close()
            rows = np.fromfile(self.folder / "setpoints.part", dtype="<i4").reshape(-1, len(SETPOINTS))
            rows = rows[: self._busy[0]]
            with open(self.folder / "setpoints.npz", "wb") as file:
                np.savez_compressed(file, columns=np.array(SETPOINTS), rows=rows)
        (self.folder / "setpoints.part").unlink(missing_ok=True)
        _write_facts(self.folder / RUN, facts)
        (self.folder / BEGUN).unlink(missing_ok=True)
        forget_oldest(self.folder.parent, KEPT)

    def _timed(self) -> list[dict[str, Any]]:
        """All events by the number of the SYNC before which they came; -1: before the start."""
        sent = np.concatenate([np.zeros(0, np.int64), *self._sent])
        taken = np.concatenate([np.zeros(0, np.int64), *self._taken])
        found = [
            (int(e["at"]), -1 if e["request"] == "stand" else 2, {k: v for k, v in e.items() if k != "at"})
            for e in self._events
        ]
        found += [(turn.tick + 1, 0, {"request": "plan", "value": turn.lead_s}) for turn in self._turns]
        found += [(int(tick), 1, {"request": "pieces"}) for tick in taken]
        found.sort(key=lambda event: event[:2])
        timed = [{"tick": self._before_tick(tick, sent), **event} for tick, _, event in found]
        if self._start is None:
            return timed
        return [{"tick": -1, "request": "begin", "value": self._start}, *timed]

    def _before_tick(self, tick: int, sent: npt.NDArray[np.int64]) -> int:
        """The number of the SYNC of a tick; what was there before the start is -1."""
        return int(np.searchsorted(sent, tick)) if tick >= self.first_tick else -1


def _write_facts(file: Path, facts: dict[str, Any]) -> None:
    whole.write(file, json.dumps(facts, indent=1))


def _stem(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name)[:60].strip(".") or "program"
    now_s = time.time()  # to the millisecond, so that the names' order is that of the runs
    return time.strftime("%Y-%m-%dT%H%M%S", time.localtime(now_s)) + f".{int(now_s * 1e3) % 1000:03d}-{plain}"


def list_runs(state: Path, most: int = 100) -> list[dict[str, Any]]:
    """The facts of the newest runs, the newest first; a run without an end is left out."""
    found = []
    for folder in sorted((state / FOLDER).glob("*"), reverse=True):
        with contextlib.suppress(OSError, ValueError):
            found.append(json.loads((folder / RUN).read_text(encoding="utf-8")))
        if len(found) >= most:
            break
    return found


def lose(state: Path) -> int:
    """Runs that a service before this one began and did not end are lost; how many.

    Such a run ended when the last of its setpoints was written.
    """
    lost = 0
    for begun in sorted((state / FOLDER).glob(f"*/{BEGUN}")):
        with contextlib.suppress(OSError, ValueError, TypeError):
            ended_s = max(file.stat().st_mtime for file in begun.parent.iterdir())
            facts = {**json.loads(begun.read_text(encoding="utf-8")), "ended_s": ended_s, "result": "lost"}
            if not (begun.parent / RUN).exists():  # it was killed between the last two steps of an end
                _write_facts(begun.parent / RUN, facts)
                lost += 1
            begun.unlink()
    return lost
