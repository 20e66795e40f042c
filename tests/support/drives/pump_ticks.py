"""A pump as a process of its own, and what a tick has beside it, on any bus that both share.

Nothing is timed: a busy computer makes all of it later, and nothing of it other.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable

from drives import pdo
from drives.bus import CanSocket, HubSocket
from drives.pump.plan_memory import FOLLOWS, Memory, Phase, PlanWriter
from drives.pump.process import BusJob, Job
from drives.pump.wires import DriveWire

T = 0.005
MASTER = 127
DRIVES = 5
HOLD = 10
WAIT_S = 60.0
BEAT_EVERY = 8


def until(done: Callable[[], bool]) -> None:
    give_up_s = time.monotonic() + WAIT_S
    while not done():
        assert time.monotonic() < give_up_s, "waited in vain"
        time.sleep(0.002)


class Tick:
    """What a tick has: a port, the memory of the plans, and a pump; ``bus`` hears what is sent."""

    def __init__(
        self, port: HubSocket | CanSocket, bus: HubSocket | CanSocket, claim: str, period_s: float = T
    ) -> None:
        """``claim``: what no two pumps play on."""
        self.port, self.bus = port, bus
        self.memory, descriptor = Memory.create(DRIVES)
        self.writer = PlanWriter(self.memory)
        for i in range(DRIVES):
            self.memory.words[i] = 0x0F | FOLLOWS
        self.control, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.control.settimeout(WAIT_S)
        wires = [(i, DriveWire(i + 1, 1, False)) for i in range(DRIVES)]
        kind = "hub" if isinstance(port, HubSocket) else "raw"
        played_on = BusJob(kind, port.fileno(), "bus", claim, wires)
        job = Job(
            *(os.getpid(), its.fileno(), descriptor, DRIVES, [played_on]),
            *(period_s, MASTER, BEAT_EVERY, 50, False),
        )
        self.job = job
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "drives.pump", job.to_text()], pass_fds=job.descriptors
        )
        its.close()
        os.close(descriptor)
        self.heard: list[tuple[int, bytes]] = []

    def ready(self) -> dict[str, bool]:
        return dict(json.loads(self.control.recv(1024)))

    def publish(self, first: int, rows: int, anew: bool = True, changes: int | None = None) -> None:
        for period in range(first, first + rows):
            self.writer.put(period, (float(period), *(1e6 * i + period for i in range(DRIVES))))
        self.writer.publish(first, first if changes is None else changes, rows, HOLD, None, anew)

    def listen(self) -> None:
        buffer = bytearray(pdo.FRAME_BYTES)
        while self.bus.receive_into(buffer):
            can_id, data = pdo.unpack(buffer)
            self.heard.append((can_id, bytes(data)))

    def until(self, done: Callable[[], bool]) -> None:
        """Listens meanwhile: a queue of Linux holds some hundred frames."""

        def heard() -> bool:
            self.listen()
            return done()

        until(heard)

    def until_silent(self, number: int = 0) -> None:
        """Until it has played a plan to its end; 0: the newest."""

        def silent() -> bool:
            played = self.writer.played()
            return played.phase is Phase.SILENT and played.number == (number or self.writer.number)

        self.until(silent)
        time.sleep(0.05)  # for the bus to deliver
        self.listen()

    def cycles(self) -> list[list[int]]:
        """Setpoints after each SYNC, without what drive they are for; heartbeats are left out."""
        found: list[list[int]] = []
        for can_id, data in self.heard:
            if can_id == pdo.SYNC:
                found.append([])
            elif can_id != pdo.HEARTBEAT + MASTER:
                drive = len(found[-1])
                assert can_id == pdo.rpdo(1, drive + 1)
                found[-1].append(pdo.COMMAND.unpack(data)[1] - 1_000_000 * drive)
        return found

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
        for one in (self.port, self.bus, self.control):
            one.close()


def begun(tick: Tick) -> int:
    """The next period that has not been prepared, with some to spare."""
    until(lambda: tick.writer.played().period > 0)
    return tick.writer.played().period + 8


def assert_none_lost_or_doubled(tick: Tick, number: int = 0) -> list[int]:
    """Each period of the plans once, in its order, for every drive; then the end held; what was sent.

    ``number`` of the last one that is played; 0: the newest.
    """
    tick.until_silent(number)
    cycles = tick.cycles()
    assert all(cycle == [cycle[0]] * DRIVES for cycle in cycles)
    sent = [cycle[0] for cycle in cycles]
    assert sent == [*range(sent[0], sent[-1] + 1), *[sent[-1]] * HOLD]
    return sent


def plans_at_any_time(tick: Tick) -> None:
    """Plans that follow each other, some of them soon and some late, but before the one before is over."""
    first = begun(tick)
    tick.publish(first - 8, 60)
    tick.until(lambda: tick.writer.played().number == 1)
    for turn in range(60):
        time.sleep(0.001 * (turn % 13))
        tick.listen()
        played = tick.writer.played().period
        tick.publish(played, 60, anew=turn % 7 == 0, changes=played + 1000)
    assert_none_lost_or_doubled(tick)
    assert tick.writer.played().refused == 0


def beside_a_thread_that_keeps_the_interpreter_lock(tick: Tick) -> None:
    first, over = begun(tick), threading.Event()
    tick.publish(first - 8, 120)
    tick.until(lambda: tick.writer.played().number == 1)

    def compute() -> None:
        while not over.is_set():
            sum(range(20_000))

    threads = [threading.Thread(target=compute) for _ in range(2)]
    for thread in threads:
        thread.start()
    try:
        for _ in range(60):
            tick.listen()
            time.sleep(0.001)  # gives the lock away, as a tick does when it sleeps
            played = tick.writer.played().period
            tick.publish(played, 120, anew=False, changes=played + 1000)
    finally:
        over.set()
        for thread in threads:
            thread.join()
    assert_none_lost_or_doubled(tick)


def half_published(tick: Tick) -> None:
    """A plan whose tick is stopped in the middle of it is none, wherever that is: the one before goes on."""
    memory, first = tick.memory, begun(tick)
    begin, rows = first - 8, 120
    tick.publish(begin, rows)
    tick.until(lambda: tick.writer.played().number == 1)
    whole = bytes(memory.areas[tick.writer.number & 1])
    other = memory.areas[(tick.writer.number + 1) & 1]
    newer = (tick.writer.number + 1).to_bytes(8, "little") + whole[8:]
    for turn in range(40):
        cut = (8, memory.head.size, memory.rows_at + 3 * turn * memory.row.size)[turn % 3]
        other[:cut] = newer[:cut]
        time.sleep(0.003)
        tick.listen()
        other[:] = bytes(len(other))
    sent = assert_none_lost_or_doubled(tick)
    assert sent[-1] == begin + rows - 1 and tick.writer.played().number == 1


def changed_too_late(tick: Tick) -> None:
    """A plan that would change what has gone out is refused, and counted."""
    first = begun(tick)
    begin, rows = first - 8, 80
    tick.publish(begin, rows)
    tick.until(lambda: tick.writer.played().period > first)
    played = tick.writer.played().period
    for period in range(played - 4, played + 200):
        tick.writer.put(period, (0.0, *[-1.0] * DRIVES))
    tick.writer.publish(played - 4, played - 2, 200, HOLD)
    tick.until(lambda: tick.writer.played().refused == 1)
    sent = assert_none_lost_or_doubled(tick, number=1)
    assert sent[-1] == begin + rows - 1


EXERCISES = (
    plans_at_any_time,
    beside_a_thread_that_keeps_the_interpreter_lock,
    half_published,
    changed_too_late,
)
