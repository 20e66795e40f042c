"""What is kept of a fault: the last seconds of every tick, every frame, and who was at fault.

A folder per fault, in the user's state folder unless told otherwise:

    2026-11-21T083120-FOLLOWING_ERROR-Z/
        trace.npz     the recorder's rows (names in ``columns``), and the machine file's text
        frames.log    every frame of every bus, as candump writes it
        fault.json    fault, axis, text, remedy, trust, the drives' states and emergency codes

It is written by the slow side once the machine stands, so that the stop is in it too.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from controller import own_files
from controller.ipc.handoff import ROW, Recorder, Snapshot, of_axes
from controller.machine.model import Machine
from controller.messages import message, text
from controller.state.fault_table import NOBODY, Sender
from controller.state.modes import FAULTS, Fault, Mode, sentence
from controller.state.record_files import TRACE
from drives import emergency_codes, pdo
from drives.cia402 import State
from drives.log import candump, frame_log
from drives.log.frame_log import FrameLog
from drives.texts import english

KEPT_S = 10.0  # before the fault
STOP_S = 3.0  # at most after it
LATE_S = 1.0  # until somebody writes it
CAUSE_S = 0.3  # at least after it: what a node says when it speaks again tells the cause
KEPT = 50  # recordings; the oldest go
STILL_TICKS = 25  # the actual positions of so many ticks agree: the drives stand
NODE_BITS = 0x7F  # of an identifier (CiA 301, 7.3.5)
STILL_COUNTS = 50.0  # encoder noise and a servo's last creeping are no motion

Rows = npt.NDArray[np.float64]
Logs = Mapping[str, FrameLog]  # by bus


@dataclass(frozen=True, slots=True)
class Facts:
    """Who was at fault."""

    fault: Fault
    axis: str  # name, "" = none or all
    tick: int
    homed: int  # bit mask of the axes
    drive_states: tuple[str, ...]
    emergencies: tuple[str, ...] = ()  # what each drive said last, "" = nothing
    axis_off: str = ""  # its name, and how far it is from its command
    sender: Sender = NOBODY  # of too many frames

    @classmethod
    def of(cls, machine: Machine, now: Snapshot, logs: Logs) -> Facts:
        """From a snapshot taken after the fault, and the frames up to it."""
        axis = machine.axis_off(now.fault_axis)
        off = machine.axis_off(now.fault_axis, now.fault_off)
        states = tuple(State(state).name for state in now.drive_states)
        return cls(
            now.fault,
            axis,
            now.tick,
            now.homed,
            states,
            tuple(_emergencies(machine, logs)),
            off,
            Sender(now.chatter_id, now.chatter_per_s),
        )

    def to_dict(self) -> dict[str, object]:
        row = FAULTS[self.fault]
        return {
            **asdict(self),
            "fault": self.fault.name,
            "class": row.reaction.name,
            "text": row.text,
            "cause": row.cause,
            "remedy": row.remedy,
            "position_trusted": row.position_trusted,
        }

    @property
    def sentence(self) -> str:
        """For the operator: the axis, what happened, what its drive said, what to do."""
        spoken = next((words for words in self.emergencies if words), "")
        whole = sentence(self.fault, self.axis_off or self.axis, sender=self.sender)
        return f"{whole} {text(message('recording.drive_said', words=spoken))}" if spoken else whole


def _emergencies(machine: Machine, logs: Logs) -> Iterator[str]:
    codes: dict[tuple[str, int], int] = {}
    for bus, log in logs.items():
        for _, frame in log.frames():
            can_id, length, data = pdo.FRAME.unpack(frame)
            if can_id & ~NODE_BITS == pdo.EMCY and length >= 2 and data[:2] != b"\0\0":
                codes[bus, can_id & NODE_BITS] = int.from_bytes(data[:2], "little")
    for axis in machine.axes:
        code = codes.get((axis.bus, axis.node), 0)
        yield english(emergency_codes.text(code)) if code else ""


def folder() -> Path:
    """Where recordings are kept unless told otherwise: the XDG state folder."""
    base = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(base) / "directrix" / "recordings"


def save(base: Path, machine: Machine, facts: Facts, rows: Rows, logs: Logs) -> Path:
    """Write one recording under ``base``, whole or not at all, and give its folder. Raises OSError.

    ``rows``: (N, len(ROW)) of the recorder, oldest first.
    """
    made = new_folder(base, _stem(facts))
    try:
        _write(made, machine, facts, rows, logs)
    except OSError:
        own_files.remove_tree(made, base.parent)  # half of one would be taken for one
        raise
    forget_oldest(base, KEPT)
    return made


def _write(made: Path, machine: Machine, facts: Facts, rows: Rows, logs: Logs) -> None:
    within = made.parent.parent
    with own_files.new(made / TRACE, within) as file:
        np.savez_compressed(
            file, columns=np.array(ROW), rows=rows, machine=np.array(machine.text), period_s=machine.period_s
        )
    with own_files.new(made / "frames.log", within) as file:
        file.writelines(f"{candump.line(*logged)}\n".encode() for logged in frame_log.merged(logs))
    with own_files.new(made / "fault.json", within) as file:
        file.write((json.dumps(facts.to_dict(), indent=1) + "\n").encode())


class Keeper:
    """Saves one recording per fault, once the machine stands; the next one after a reset."""

    def __init__(self, machine: Machine, recorder: Recorder, logs: Logs, base: Path) -> None:
        self.saved: Path | None = None  # of the present fault
        self.problem = ""  # why nothing could be saved
        self._machine, self._recorder, self._logs, self._base = machine, recorder, logs, base
        self._seen_tick = -1  # at which the fault was first seen

    def look(self, now: Snapshot) -> bool:
        """Call it often. True once nothing is left to do: the fault is kept, or there is none."""
        if now.mode is not Mode.FAULT:
            self._seen_tick, self.saved, self.problem = -1, None, ""
            return True
        if self.saved is not None or self.problem:
            return True
        if self._seen_tick < 0:
            self._seen_tick = now.tick
        if not self.settled(now, self._seen_tick):
            return False
        self.keep(now)
        return True

    def settled(self, now: Snapshot, seen_tick: int, stops: bool = True) -> bool:
        """Whether all that a recording waits for has come since that tick; ``stops``: a standstill, too."""
        since_s = (now.tick - seen_tick) * self._machine.period_s
        if since_s < CAUSE_S or since_s >= STOP_S or not stops:
            return since_s >= CAUSE_S
        return now.at_rest and stands(self._recorder.last(STILL_TICKS), self._machine)

    def keep(self, now: Snapshot, fault: Fault | None = None) -> None:
        """Save at once, under another name than the snapshot's if the tick could not tell it."""
        try:
            self.saved = self.save(now if fault is None else now._replace(fault=fault, fault_axis=-1))
        except OSError as error:
            self.problem = text(message("recording.not_written", folder=self._base, why=error))

    def save(self, now: Snapshot) -> Path:
        """Save what was before this snapshot, named by its fault; any thread may. Raises OSError."""
        rows = self._recorder.last(round((KEPT_S + STOP_S + LATE_S) / self._machine.period_s))
        facts = Facts.of(self._machine, now, self._logs)
        return save(self._base, self._machine, facts, rows, self._logs)

    @property
    def location_text(self) -> str:
        """Where the recording lies, or why there is none; to be put after the fault's sentence."""
        if self.saved:
            return " " + text(message("recording.lies", folder=self.saved))
        return f" {self.problem}" if self.problem else ""


def stands(rows: Rows, machine: Machine) -> bool:
    """Whether the drives have stood for the last ticks, by their own positions."""
    last = rows[-STILL_TICKS:, of_axes("actual", len(machine.axes))]
    if len(last) < STILL_TICKS:
        return False
    moved = (last.max(axis=0) - last.min(axis=0)) * [abs(axis.counts_per_unit) for axis in machine.axes]
    return bool((moved <= STILL_COUNTS).all())


def new_folder(base: Path, stem: str) -> Path:
    """A folder that was not there, named after ``stem``, which begins with the time. Raises OSError."""
    for n in range(1, 1000):
        made = base / (stem if n == 1 else f"{stem}-{n}")
        with contextlib.suppress(FileExistsError):
            own_files.make_new_folder(made, base.parent)
            return made
    raise FileExistsError(f"{base}: there are a thousand folders named {stem}")


def forget_oldest(base: Path, kept: int) -> None:
    """All but so many are deleted; names begin with the time, so the first are the oldest."""
    for old in own_files.names(base, base.parent)[:-kept]:
        own_files.remove_tree(base / old, base.parent)


def _stem(facts: Facts) -> str:
    stem = time.strftime("%Y-%m-%dT%H%M%S", time.localtime()) + f"-{facts.fault.name}"
    return f"{stem}-{facts.axis}" if facts.axis else stem
