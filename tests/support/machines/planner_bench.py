"""A planner without a tick: what it sends of a whole program, in a fraction of the time of a run."""

from __future__ import annotations

import numpy as np
from support.machines import traced_programs
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import Piece, PieceMessage, Snapshot
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.planner import Planner
from controller.state.modes import Fault, Mode

BEGIN_S = 7.0
LEAD_S = 0.02


class PlannerBench:
    """A planner, and a tick that takes (or refuses) what it says and stands where it is told to."""

    def __init__(self, source: str, machine: Machine | None = None) -> None:
        self.machine = machine or shipped()
        home = tuple(axis.homing.position for axis in self.machine.axes)
        self.items = traced_programs.trace(source, self.machine, home).items  # type: ignore[arg-type]
        self.sent: list[PieceMessage] = []
        self.queue: list[tuple[float, Piece]] = []  # begin and piece, as the tick would have them
        self.planner = Planner(self.machine, kinematics_of(self.machine), self._send)
        self.planner.load(self.items, BEGIN_S)
        five = (0.0,) * 5
        fields = dict.fromkeys(Snapshot._fields, 0) | {
            "mode": Mode.RUNNING,
            "fault": Fault.NONE,
            "override": 1.0,
            "rapid_override": 1.0,
            "joints": five,
            "actual": five,
            "drive_states": (0,) * 5,
        }
        self.now = Snapshot(**fields)  # type: ignore[arg-type]
        self.at(BEGIN_S)

    def _send(self, message: PieceMessage) -> bool:
        self.sent.append(message)
        return True

    @property
    def end_s(self) -> float:
        return self.queue[-1][0] + self.queue[-1][1].duration_s if self.queue else BEGIN_S

    def at(self, plan_time_s: float, **changes: object) -> None:
        """The tick has come to a plan time."""
        commit_s = min(plan_time_s + LEAD_S, max(self.end_s, plan_time_s))
        self.now = self.now._replace(plan_time_s=plan_time_s, commit_s=commit_s, **changes)  # type: ignore[arg-type]

    def turn(self, take: bool = True) -> PieceMessage | None:
        """One turn of the planner; what it said, if it did."""
        before = len(self.sent)
        self.planner.work(self.now)
        assert len(self.sent) <= before + 1
        if len(self.sent) == before:
            return None
        message = self.sent[-1]
        if take:
            self._take(message)
        else:
            self.now = self.now._replace(rejected=message.sequence)
        return message

    def _take(self, message: PieceMessage) -> None:
        start = message.replace_from_s
        assert start <= self.end_s + 1e-9
        kept = [(at, piece) for at, piece in self.queue if at < start - 1e-9]
        if kept:
            at, piece = kept[-1]
            kept[-1] = (at, piece._replace(duration_s=min(piece.duration_s, start - at)))
        for piece in message.pieces:
            kept.append((start, piece))
            start += piece.duration_s
        self.queue = kept
        self.now = self.now._replace(accepted=message.sequence)

    def fill(self) -> None:
        """Turns at the present plan time until nothing more is said."""
        while self.turn() is not None:
            pass

    def run(self, step_s: float = 0.4) -> None:
        """All of the program."""
        self.fill()
        while not self.planner.finished or self.now.plan_time_s < self.end_s:
            self.at(self.now.plan_time_s + step_s)
            self.fill()

    def speeds(self, from_s: float, to_s: float, step_s: float = 0.01) -> np.ndarray:
        """ds/dt of the queue."""
        return np.array([self.state(t)[1] for t in np.arange(from_s, to_s, step_s)])

    def state(self, t: float) -> tuple[float, float, float]:
        at, piece = next((at, p) for at, p in reversed(self.queue) if at <= t)
        return piece.law.at(t - at)
