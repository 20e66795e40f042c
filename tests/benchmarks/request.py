"""From a request to the first frame that it changes, on the wall clock: a jog of a machine that stands.

The real loop runs in a process of its own with five drives played here. A jog is asked for at a random
moment; the kernel's time stamps at the far end of the socket say when the SYNC of the tick left that took it,
and when the first setpoint left that is another one. Beside it stands what the same datagram takes to a
process that waits for nothing else and answers at once.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import random
import select
import socket
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.machines.shipped_kinds import machine as make_machine  # noqa: E402
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402
from sync import PRIORITY, REPORT, SO_TIMESTAMPNS, STAMP  # noqa: E402

from controller.ipc.handoff import (  # noqa: E402
    Jog,
    PieceInbox,
    Recorder,
    RequestInbox,
    SnapshotBoard,
    piece_pair,
    request_pair,
    send_jog,
    send_request,
)
from controller.machine.model import Machine  # noqa: E402
from controller.state.modes import Request  # noqa: E402
from controller.tick import loop  # noqa: E402
from controller.tick.cycle import Cycle  # noqa: E402
from drives import pdo, real_time  # noqa: E402
from drives.bus import HubSocket  # noqa: E402
from drives.cyclic.drive import Drive  # noqa: E402
from drives.cyclic.group import Group  # noqa: E402
from drives.settings import MasterSettings, NodeSettings  # noqa: E402

PERIOD_S = 2e-3
STEP = Jog((1.0, 0.0, 0.0, 0.0, 0.0), 20.0, 0.2)


def tick_process(machine: Machine, near: socket.socket, requests: socket.socket, stop: Connection) -> None:
    nodes = [NodeSettings(a.name, a.bus, a.node, "", period_s=machine.period_s) for a in machine.axes]
    group = Group(
        [Drive(node) for node in nodes],
        {machine.axes[0].bus: HubSocket(near, "main")},
        MasterSettings(period_s=machine.period_s),
    )
    clock, (_, piece_end) = loop.WallClock(), piece_pair()
    cycle = Cycle(
        machine,
        group,
        PieceInbox(piece_end),
        RequestInbox(requests, len(machine.axes)),
        SnapshotBoard(),
        Recorder(),
        clock.now_s,
    )
    real_time.prepare(PRIORITY)
    loop.Loop(cycle, clock).run(lambda: not stop.poll())


class Drives:
    """Five of them, played: they are where they were told to be."""

    def __init__(self, far: socket.socket, machine: Machine) -> None:
        far.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self.far, self.targets = far, {axis.node: 0 for axis in machine.axes}
        self.sync_s = self.sent_s = 0.0  # stamps of the last SYNC, and of the last setpoints of others

    def look(self, seconds: float) -> bool:
        """Takes what comes meanwhile; whether a setpoint has changed."""
        until_s = time.monotonic() + seconds
        while (left_s := until_s - time.monotonic()) > 0.0:
            if select.select([self.far], [], [], left_s)[0] and self._packet():
                return True
        return False

    def _packet(self) -> bool:
        packet, notes, _, _ = self.far.recvmsg(4096, 64)
        whole_s, nanoseconds = STAMP.unpack(notes[0][2][: STAMP.size])
        stamp_s, changed = whole_s + 1e-9 * nanoseconds, False
        for i in range(0, len(packet), pdo.FRAME_BYTES):
            can_id, _ = pdo.HEADER.unpack_from(packet, i)
            if can_id == pdo.SYNC:
                self.sync_s = stamp_s
                self._answer()
            elif can_id - pdo.RPDO1 in self.targets:
                _, target = pdo.COMMAND.unpack_from(packet, i + pdo.DATA_AT)
                changed |= self.targets[can_id - pdo.RPDO1] != target
                self.targets[can_id - pdo.RPDO1] = target
        self.sent_s = stamp_s if changed else self.sent_s
        return changed

    def _answer(self) -> None:
        for node, target in self.targets.items():
            self.far.send(pdo.frame(pdo.TPDO1 + node, REPORT[:2] + target.to_bytes(4, "little", signed=True)))


def measured(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Seconds from a request to the SYNC of its tick, and from there to its first setpoint, (count,) each."""
    machine, dice = make_machine(period_s=PERIOD_S), random.Random(1)
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    operator, requests = request_pair()
    ends, stop = multiprocessing.Pipe()
    context = multiprocessing.get_context("fork")
    child = context.Process(target=tick_process, args=(machine, near, requests, stop))
    child.start()
    found, drives = [], Drives(far, machine)
    with contextlib.suppress(PermissionError):  # drives have processors of their own
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY - 1))
    try:
        send_request(operator, Request.ENABLE)
        drives.look(0.3)
        for number in range(1, count + 1):
            while drives.look(0.05 + dice.random() * PERIOD_S):
                pass  # at rest
            asked_s = time.time()
            send_jog(operator, STEP, number)
            if drives.look(1.0):
                found.append((drives.sync_s - asked_s, drives.sent_s - drives.sync_s))
                continue
            for request in (
                Request.RESET,
                Request.ENABLE,
            ):  # the computer was away for longer than drives wait
                send_request(operator, request)
                drives.look(0.3)
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        ends.send("end")
        drives.look(0.2)
        child.join(5.0)
        child.kill()
        child.join()
    assert found, "no jog has moved anything"
    waited, worked = np.array(found).T
    return waited, worked


def echo(end: socket.socket) -> None:
    while data := end.recv(4096):
        end.send(data)


def echoed_s(count: int) -> np.ndarray:
    """Seconds of a datagram to a process that waits for it and back, (count,)."""
    mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    child = multiprocessing.get_context("fork").Process(target=echo, args=(its,), daemon=True)
    child.start()
    its.close()
    found = []
    for _ in range(count):
        time.sleep(PERIOD_S)
        began_s = time.perf_counter()
        mine.send(bytes(64))
        mine.recv(4096)
        found.append(time.perf_counter() - began_s)
    mine.close()
    child.kill()
    child.join()
    return np.array(found)


def report(short: bool) -> Report:
    count = 5 if short else 200
    waited, worked = measured(count)
    there = figures.percentiles("request to frame", waited + worked, None, "ms", 1e3, "")
    back = figures.percentiles("datagram and back", echoed_s(count), None, "ms", 1e3, "")
    found = [Figure(a.name, a.value, a.unit, b.value, b.name) for a, b in zip(there, back, strict=True)]
    median = Figure("request to frame, median", found[0].value, "ms", 1e3 * PERIOD_S, "the period")
    parts = figures.shares({"until its tick": float(waited.sum()), "in its tick": float(worked.sum())})
    return Report((*found, median), parts, "request to frame")


if __name__ == "__main__":
    figures.main(report)
