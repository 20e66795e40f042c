"""What one tick costs, wake-up excluded: five drives on a socket, cutting Example 2.

The tick is the real one (cycle, group, drives, sockets); the far end of the socket is filled with the drives'
answers before each tick and emptied after it, outside of the measured time. Paced it goes as ``loop.Loop``
does: it sleeps to shortly before the deadline, so that caches are as cold as in production, rehearses, drains
the bus, spins to the deadline and runs. The tick is the drain and the run; the rehearsal, for which the loop
would spin otherwise, stands beside it. So does the paced tick without one, taken in turn with it, for other
work on the computer changes both. In turn with both goes the tick that has a pump: it comes after the pump
has handed its period over, which is another process on a machine and outside of the measured time here, and
it looks ahead and publishes a plan. Others on the same hardware make every turn slower and none faster: what
is promised is of the calmest turn (by its median), and all turns together stand beside it. The share of each
step is taken in a last pass, whose stop watches cost a little themselves.
"""

from __future__ import annotations

import math
import socket
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.machines.shipped_kinds import machine as make_machine  # noqa: E402
from support.machines.tick_bench import cut_start, ruled_cut, stops  # noqa: E402
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.ipc.handoff import (  # noqa: E402
    PieceInbox,
    PieceMessage,
    PieceOutbox,
    Recorder,
    RequestInbox,
    SnapshotBoard,
    piece_pair,
    request_pair,
    send_request,
)
from controller.machine.model import Machine  # noqa: E402
from controller.runtime import cyclic  # noqa: E402
from controller.state.modes import Mode, Request  # noqa: E402
from controller.tick import loop  # noqa: E402
from controller.tick.cycle import Cycle  # noqa: E402
from drives import pdo, real_time  # noqa: E402
from drives.bus import HubSocket  # noqa: E402
from drives.cyclic.drive import Drive  # noqa: E402
from drives.cyclic.group import Group  # noqa: E402
from drives.pump.plan_memory import Memory  # noqa: E402
from drives.pump.player import Player  # noqa: E402
from drives.settings import MasterSettings, NodeSettings  # noqa: E402

KEEPALIVE_TICKS = 10
PERIOD_S = 1e-3
TURNS = 8
CLOCK = loop.WallClock()
WHOLE = "whole"
OPERATION_ENABLED = 0x1237  # with voltage, remote and "follows command"
STOPS = stops(1000.0, 20000.0)  # mm/s2, mm/s3, well within what the axes may do on the cut


class Rig:
    """The tick and, at the far end of its socket, drives that are where they were told to be."""

    def __init__(self, machine: Machine, with_pump: bool) -> None:
        near, self.far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.far.setblocking(False)
        nodes = [NodeSettings(a.name, a.bus, a.node, "", period_s=machine.period_s) for a in machine.axes]
        self.nodes = [node.node for node in nodes]
        piece, self.cut = ruled_cut(machine)
        start = cut_start(machine, self.cut)
        self.positions = {
            axis.node: round(q * axis.counts_per_unit) for axis, q in zip(machine.axes, start, strict=True)
        }
        self.piece, self.stops = piece, STOPS(piece, 0.0, machine.period_s)
        group = Group(
            [Drive(node) for node in nodes],
            {machine.axes[0].bus: HubSocket(near, "main")},
            MasterSettings(period_s=machine.period_s),
        )
        plans = Memory(len(machine.axes)) if with_pump else None
        self.pump = cyclic.player(machine, group, plans) if plans is not None else None
        plan_end, piece_end = piece_pair()
        self.operator, request_end = request_pair()
        self.plan = PieceOutbox(plan_end)
        self.now_s = 0.0
        self.cycle = Cycle(
            machine,
            group,
            PieceInbox(piece_end),
            RequestInbox(request_end),
            SnapshotBoard(),
            Recorder(),
            time.monotonic,
            plans,
        )
        self.sequence = 0

    def answer(self) -> None:
        """Each drive reports; the planner says it lives."""
        for node in self.nodes:
            data = OPERATION_ENABLED.to_bytes(2, "little") + self.positions[node].to_bytes(
                4, "little", signed=True
            )
            self.far.send(pdo.frame(pdo.TPDO1 + node, data))
        if self.cycle.tick % KEEPALIVE_TICKS == 0:
            self.plan.send(PieceMessage(self.sequence, 0.0))

    def empty(self) -> None:
        """Takes what the tick sent; drives move to their setpoints."""
        while True:
            try:
                packet = self.far.recv(4096)
            except BlockingIOError:
                return
            for i in range(0, len(packet), pdo.FRAME_BYTES):
                can_id, _ = pdo.HEADER.unpack_from(packet, i)
                node = can_id - pdo.RPDO1
                if node in self.positions:
                    _, target = pdo.COMMAND.unpack_from(packet, i + pdo.DATA_AT)
                    self.positions[node] = target

    def tick(self, deadline_s: float = 0.0, rehearses: bool = False) -> tuple[float, float]:
        """One tick, paced where it has a deadline (monotonic); its cost (s), and that of its rehearsal."""
        cycle, now = self.cycle, time.perf_counter
        period_s = cycle.machine.period_s
        self.answer()
        self.now_s += period_s
        if self.pump is not None:
            return self._tick_after(self.pump, deadline_s), 0.0
        cycle.sync._synced_s = self.now_s - period_s  # the pace is ours, not the wall clock's
        if deadline_s:
            CLOCK.wake(deadline_s, loop.early_s(period_s))
        began_s = now()
        if rehearses:
            cycle.rehearse(self.now_s)
        rehearsed_s = now()
        cycle.receive(self.now_s)
        received_s = now()
        CLOCK.spin(deadline_s)
        start_s = now()
        cycle.run(self.now_s, 0.0)
        cost_s = now() - start_s + received_s - rehearsed_s
        self.empty()
        return cost_s, rehearsed_s - began_s

    def _tick_after(self, pump: Player, deadline_s: float) -> float:
        """The cost (s) of a tick for which the pump has handed the period over."""
        cycle, now = self.cycle, time.perf_counter
        pump.prepare()
        pump.send(round((self.now_s + cycle.machine.period_s) * 1e9), 0)
        if deadline_s:
            CLOCK.wake(deadline_s, 0.0)
        start_s = now()
        assert cycle.run_with_pump(self.now_s + loop.PUMP_TAKES_S)
        cost_s = now() - start_s
        self.empty()
        return cost_s

    def start(self) -> None:
        send_request(self.operator, Request.ENABLE)
        for _ in range(10):
            self.tick()
        assert self.cycle.modes.mode is Mode.READY, self.cycle.modes.mode
        self.run_again()

    def run_again(self) -> None:
        """The cut once more, from its start: the drives are put back there."""
        cycle = self.cycle
        follow, machine = cycle.follow, cycle.machine
        send_request(self.operator, Request.STOP)
        self.tick()
        while self.cycle.modes.mode is not Mode.READY:
            self.tick()
        start = cut_start(machine, self.cut)
        follow.set_joints(start)
        if cycle.stock is not None:
            cycle.stock.moved_otherwise()
        for axis, q in zip(machine.axes, start, strict=True):
            self.positions[axis.node] = round(q * axis.counts_per_unit)
        self.sequence += 1
        begins_s = follow.queue_end_s
        of_message = {self.piece.motion_id: self.cut}, (self.piece,), (replace(self.stops, start_s=begins_s),)
        made = PieceMessage(self.sequence, begins_s, *of_message, epoch=follow.epoch)
        self.plan.send(made)
        self.tick()
        send_request(self.operator, Request.START)
        self.tick()
        assert follow.pending, "the tick has refused the cut"


def measure(rig: Rig, ticks: int, paced: bool, rehearses: bool = False) -> np.ndarray:
    """Costs (s) of ``ticks`` cutting ticks, and of their rehearsals: (ticks, 2)."""
    costs = np.empty((ticks, 2))
    period_s = rig.cycle.machine.period_s
    next_s = time.monotonic()
    for n in range(ticks):
        if not rig.cycle.follow.pending:
            rig.run_again()
        next_s = max(next_s + period_s, time.monotonic())
        costs[n] = rig.tick(next_s, rehearses) if paced else rig.tick()
    return costs


def in_turn(rig: Rig, pumped: Rig, ticks: int) -> tuple[list[np.ndarray], ...]:
    """Paced ticks with and without a rehearsal, and of one with a pump, in ``TURNS`` turns each."""
    kinds: tuple[list[np.ndarray], ...] = [], [], []
    for _ in range(TURNS):
        for found, one, rehearses in zip(kinds, (rig, rig, pumped), (True, False, False), strict=True):
            found.append(measure(one, ticks // TURNS, paced=True, rehearses=rehearses))
    return kinds


class Watches:
    """A stop watch around the whole tick and one around each of its steps, which do not overlap."""

    def __init__(self, cycle: Cycle) -> None:
        self.spent: dict[str, float] = {}
        self._watch(cycle.group, "receive", "receive")
        self._watch(cycle, "_sync", "SYNC")
        self._watch(cycle, "_take_requests", "requests")
        self._watch(cycle, "_take_pieces", "pieces")
        self._watch(cycle, "_supervise", "supervise")
        self._watch(cycle.follow, "step", "follow + joints")
        self._watch(cycle, "_judge", "check + encode")
        self._watch(cycle.group, "command", "send")
        self._watch(cycle._status, "record", "snapshot + recorder")
        for half in ("receive", "run"):
            self._watch(cycle, half, WHOLE)

    def shares(self) -> dict[str, float]:
        """Of the ticks that were run since, between two cuts too; what no step has is the rest."""
        whole = self.spent[WHOLE]
        shares = {name: spent / whole for name, spent in self.spent.items() if name != WHOLE}
        return {**shares, "rest (and stop watches)": 1.0 - math.fsum(shares.values())}

    def _watch(self, owner: Any, method: str, name: str) -> None:
        inner: Callable[..., Any] = getattr(owner, method)
        self.spent[name] = 0.0

        def watched(*arguments: Any) -> Any:
            start = time.perf_counter()
            result = inner(*arguments)
            self.spent[name] += time.perf_counter() - start
            return result

        setattr(owner, method, watched)


def report(short: bool) -> Report:
    """Back to back, and paced: the same tick with the caches of a machine."""
    rig, pumped = (Rig(make_machine(period_s=PERIOD_S), with_pump) for with_pump in (False, True))
    rig.start()
    pumped.start()
    real_time.prepare()
    ticks = 80 if short else 8000
    measure(rig, ticks // 4, paced=False)
    together = measure(rig, ticks, paced=False)[:, 0]
    measure(pumped, ticks // 4, paced=False)
    at_once = measure(pumped, ticks, paced=False)[:, 0]
    turns, others, after_pump = in_turn(rig, pumped, ticks)
    rehearsed, without, with_pump = (np.concatenate(one) for one in (turns, others, after_pump))
    watches = Watches(rig.cycle)
    measure(rig, ticks, paced=True, rehearses=True)
    paced = rehearsed[:, 0]
    calmest = min((turn[:, 0] for turn in turns), key=np.median)
    found = [
        *_promised(figures.percentiles("paced tick, calmest turn", calmest, paced, "us", 1e6, "all turns")),
        *figures.percentiles("paced tick", paced, together, "us", 1e6, "back to back"),
        *figures.percentiles(
            "paced tick without rehearsal", without[:, 0], together, "us", 1e6, "back to back"
        ),
        *figures.percentiles("paced tick with a pump", with_pump[:, 0], at_once, "us", 1e6, "back to back"),
        *figures.percentiles("rehearsal", rehearsed[:, 1], None, "us", 1e6, ""),
        Figure("paced tick, share of the period", float(np.mean(paced)) / PERIOD_S, ""),
    ]
    return Report(tuple(found), watches.shares(), "a paced tick")


def _promised(found: Sequence[Figure]) -> list[Figure]:
    """Median and 99 % with what is promised of them, and the others."""
    median, near_all, *others = found
    return [replace(median, at_most=80.0), replace(near_all, at_most=160.0), *others]


if __name__ == "__main__":
    figures.main(report)
