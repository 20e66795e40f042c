"""How late SYNC leaves, beside ``cyclictest`` (Debian: rt-tests) in the same run.

They take turns with the same period and priority on the same computer, so that a
noisy neighbour meets all. ``cyclictest`` measures how late a thread in C wakes up; the
loop is measured at its SYNC: lateness when it is sent, and intervals between SYNCs by
the kernel's time stamps at the far end of the socket. A simple echo plays five drives there.
SYNC is a pump's, as on a machine; in turn with it goes a loop that has none and sends by itself.

A host that takes a processor away for some milliseconds spoils the turn that it meets, whosever it is: one
such turn makes the 99.9 % of all turns together. So each figure is that of the middle turn, and all turns
together stand behind it.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import select
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.machines.shipped_kinds import machine as make_machine  # noqa: E402
from support.suite import cyclictest, figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.ipc.handoff import (  # noqa: E402
    COLUMN,
    PieceInbox,
    Recorder,
    RequestInbox,
    SnapshotBoard,
    piece_pair,
    request_pair,
    send_request,
)
from controller.machine.model import Machine  # noqa: E402
from controller.runtime.pump_process import PumpProcess  # noqa: E402
from controller.state.modes import Request  # noqa: E402
from controller.tick import loop  # noqa: E402
from controller.tick.cycle import Cycle  # noqa: E402
from drives import pdo, real_time  # noqa: E402
from drives.bus import HubSocket  # noqa: E402
from drives.cyclic.drive import Drive  # noqa: E402
from drives.cyclic.group import Group  # noqa: E402
from drives.pump.plan_memory import Memory  # noqa: E402
from drives.settings import MasterSettings, NodeSettings  # noqa: E402

SO_TIMESTAMPNS = 35
STAMP = struct.Struct("qq")
REPORT = (0x1237).to_bytes(2, "little") + bytes(4)  # operation enabled, at zero
BESIDE = "cyclictest"
PRIORITY = 80
KINDS = {"": True, ", without a pump": False}
TURN = 2000  # periods
ROUNDS = 6


def tick_process(
    machine: Machine, near: socket.socket, seconds: float, priority: int, with_pump: bool, out: Connection
) -> None:
    """The real loop and cycle, drives enabled and standing; sends its lateness when done."""
    nodes = [NodeSettings(a.name, a.bus, a.node, "", period_s=machine.period_s) for a in machine.axes]
    group = Group(
        [Drive(node) for node in nodes],
        {machine.axes[0].bus: HubSocket(near, "main")},
        MasterSettings(period_s=machine.period_s),
    )
    plans = pump = None
    if with_pump:
        plans, descriptor = Memory.create(len(machine.axes))
        pump = PumpProcess(machine, group, descriptor, 0.0)
    _, piece_end = piece_pair()
    operator, request_end = request_pair()
    recorder = Recorder(rows=1 << 17)
    clock = loop.WallClock()
    cycle = Cycle(
        machine,
        group,
        PieceInbox(piece_end),
        RequestInbox(request_end),
        SnapshotBoard(),
        recorder,
        clock.now_s,
        plans,
    )
    send_request(operator, Request.ENABLE)
    granted = pump.wait_until_ready() if pump is not None else real_time.Granted()
    granted = granted & real_time.prepare(priority)
    ends_s = time.monotonic() + seconds
    turning = loop.Loop(cycle, clock, with_pump=with_pump, pump=pump)
    turning.run(lambda: time.monotonic() < ends_s)
    if pump is not None:
        pump.end()
    if turning.error is not None:
        raise turning.error
    rows = recorder.drain()[cyclictest.WARM_UP :]
    out.send((rows[:, COLUMN["lateness_s"]], cycle.sync.skips, dict(granted)))


def play_drives(far: socket.socket, stop: Connection) -> np.ndarray:
    """Answers every SYNC for five drives; returns the kernel's stamps of the SYNCs (s)."""
    far.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    answers = [bytes(pdo.frame(pdo.TPDO1 + node, REPORT)) for node in range(1, 6)]
    stamps = []
    while True:
        readable, _, _ = select.select([far, stop], [], [], 1.0)
        if far in readable:
            packet, notes, _, _ = far.recvmsg(4096, 64)
            if pdo.HEADER.unpack_from(packet)[0] == pdo.SYNC:
                seconds, nanoseconds = STAMP.unpack(notes[0][2][: STAMP.size])
                stamps.append(seconds + nanoseconds * 1e-9)
                # A tick that has ended takes none any more, while its pump still plays the plan to its end.
                with contextlib.suppress(BlockingIOError, ConnectionError):
                    for answer in answers:
                        far.send(answer, socket.MSG_DONTWAIT)
        elif stop in readable:
            return np.array(stamps)


def run_loop(
    seconds: float, period_s: float, priority: int, with_pump: bool = True
) -> tuple[np.ndarray, np.ndarray, int, dict[str, bool]]:
    """(lateness, SYNC stamps, skips, privileges) of one turn of our loop."""
    machine = make_machine(period_s=period_s)
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    mine, theirs = multiprocessing.Pipe()
    child = multiprocessing.get_context("fork").Process(
        target=tick_process, args=(machine, near, seconds, priority, with_pump, theirs)
    )
    child.start()
    stamps = play_drives(far, mine)
    lateness, skips, granted = mine.recv()
    child.join()
    near.close()
    far.close()
    return lateness, stamps[cyclictest.WARM_UP :], skips, granted


@contextlib.contextmanager
def load(wanted: bool) -> Iterator[None]:
    """Somebody who keeps all processors and the memory busy at normal priority, as plan and panel may."""
    work = "import numpy\nwhile True: numpy.sort(numpy.random.rand(200_000))"
    busy = [subprocess.Popen([sys.executable, "-c", work]) for _ in range(os.cpu_count() or 1) if wanted]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


class Turns(NamedTuple):
    """Of one kind, each turn by itself (s)."""

    off: list[np.ndarray]  # of an interval between two SYNCs
    late: list[np.ndarray]


def _middle(turns: list[np.ndarray]) -> np.ndarray:
    """The turn in the middle by what is furthest off."""
    return sorted(turns, key=lambda turn: np.percentile(turn, 99.9))[len(turns) // 2]


def beside(loaded: bool, period_s: float, periods: int, rounds: int) -> tuple[list[Figure], np.ndarray, int]:
    """SYNC and cyclictest in turns; the deviations of a pump's SYNC, and how many ticks sent none."""
    theirs, ours, skips = Turns([], []), {kind: Turns([], []) for kind in KINDS}, 0
    with load(loaded):
        for n in range(rounds):
            samples = cyclictest.turn(periods * period_s, period_s, PRIORITY)
            theirs.late.append(samples)
            theirs.off.append(np.abs(np.diff(samples)))
            for kind in (list(KINDS), list(reversed(KINDS)))[n % 2]:
                lateness, stamps, skipped, _ = run_loop(periods * period_s, period_s, PRIORITY, KINDS[kind])
                ours[kind].late.append(lateness)
                ours[kind].off.append(np.abs(np.diff(stamps) - period_s))
                skips += skipped
    found = list[Figure]()
    for kind, turns in ours.items():
        for of, which in ((_middle, ""), (np.concatenate, "all turns, ")):
            name = f"{1e3 * period_s:g} ms, {'loaded' if loaded else 'idle'}{kind}: {which}"
            mine, other, late, woken = map(of, (turns.off, theirs.off, turns.late, theirs.late))
            outside = [float(np.mean(one > 0.25 * period_s)) * 100.0 for one in (mine, other)]
            found += [
                Figure(f"{name}outside 1 +- 1/4", outside[0], "%", outside[1], BESIDE),
                *figures.percentiles(f"{name}interval off", mine, other, "us", 1e6, BESIDE),
                *figures.percentiles(f"{name}late", late, woken, "us", 1e6, f"{BESIDE}'s wake-up"),
            ]
    return found, np.concatenate(ours[""].off) / period_s, skips


def report(short: bool) -> Report:
    cyclictest.needed()
    found: list[Figure] = []
    for loaded in (False, True):
        for period_s in (2e-3,) if short else (2e-3, 1e-3, 0.5e-3):
            some, off, skips = beside(loaded, period_s, TURN // 8 if short else TURN, 1 if short else ROUNDS)
            found += some
    whole = f"SYNCs at {1e3 * period_s:g} ms, loaded ({skips} ticks sent none)"
    return Report(tuple(found), figures.by_lateness(off), whole)


if __name__ == "__main__":
    figures.main(report)
