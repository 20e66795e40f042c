"""The pump on this computer's clock: a process of its own, which only plays what a tick has published.

```
   due           t0 + m T                    t0 + (m + 1) T
   awake       |--| SYNC, setpoints, record |--|
   the tick          |-- computes ---- publishes
```
It shares the tick's descriptors, so that on the bus both are one and neither hears the other. If it is late
by more than ``LATE_SHARE`` of the period, all later periods move on with it: no two SYNCs are nearer than the
rest of the period, and none is left out. It ends with its plan: when told to, or when the tick is gone.

Nothing here locks, logs, or allocates anything that stays.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import time
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple
from zlib import crc32

from drives import real_time
from drives.ports.port import FrameSocket, HubSocket
from drives.pump.plan_memory import Memory, Phase
from drives.pump.player import EARLY_SHARE, LATE_SHARE, Player
from drives.pump.wires import BusWire, DriveWire, Sends

EARLY_S: Final = (150e-6, 300e-6)  # within this it is awake ``EARLY_SHARE`` of the period before its time
CLAIM_S: Final = 5.0  # in which the pump of a tick that has died comes to its end
NAME: Final = "directrix-pump"  # as ``ps`` shows it
CLAIMED: Final = 3  # exit code: another pump plays on one of the buses
_SILENT: Final = Phase.SILENT


class BusJob(NamedTuple):
    """One bus: ``kind`` of the descriptor, "raw" (one frame a packet), "hub" or "slcan"."""

    kind: str
    descriptor: int
    name: str
    claim: str  # what no other pump may play on
    drives: Sequence[tuple[int, DriveWire]]  # with the place of each in the order of the axes
    spindle: DriveWire | None = None


class Job(NamedTuple):
    """What a pump is given. ``control``: its end of a socket to the tick; ``plans``: of the memory."""

    parent: int
    control: int
    plans: int
    axes: int
    buses: Sequence[BusJob]
    period_s: float
    master: int
    beat_every: int
    priority: int
    thread: bool  # axes can be tied to the spindle

    def to_text(self) -> str:
        return json.dumps(self)

    @classmethod
    def from_text(cls, text: str) -> Job:
        job = cls(*json.loads(text))
        buses = [BusJob(*bus) for bus in job.buses]
        return job._replace(
            buses=[
                bus._replace(
                    drives=[(place, DriveWire(*wire)) for place, wire in bus.drives],
                    spindle=None if bus.spindle is None else DriveWire(*bus.spindle),
                )
                for bus in buses
            ]
        )

    @property
    def descriptors(self) -> tuple[int, ...]:
        """All that are handed over."""
        return (self.control, self.plans, *(bus.descriptor for bus in self.buses))


class Pump:
    """Plays period after period until ``over``."""

    def __init__(
        self,
        player: Player,
        memory: Memory,
        period_s: float,
        hubs: Sequence[HubSocket],
        replaced: Callable[[], None] = lambda: None,
    ) -> None:
        """``hubs``: the buses that take frames ahead of their time; ``replaced``: looks for new descriptors
        of theirs.
        """
        self._player, self._memory, self._hubs, self._replaced = player, memory, hubs, replaced
        self._period_ns = round(period_s * 1e9)
        self._latest_ns = round(LATE_SHARE * period_s * 1e9)
        self._early_ns = round(min(max(EARLY_SHARE * period_s, EARLY_S[0]), EARLY_S[1]) * 1e9)
        self._due_ns = 0

    def run(self, over: Callable[[], bool]) -> None:
        """Until ``over``, which is asked after every period."""
        self._due_ns = time.monotonic_ns() + self._period_ns
        while not over():
            at_once = self._memory.at_once
            if at_once > 1 and self._hubs:
                self._play_ahead(at_once)
            else:
                self._play(self._early_ns if at_once < 1 else 0)
            if self._player.unsent:
                self._replaced()

    def _play(self, early_ns: int) -> None:
        """One period; awake so long before."""
        now_ns = time.monotonic_ns
        left_ns = self._due_ns - early_ns - now_ns()
        if left_ns > 0:
            time.sleep(left_ns * 1e-9)
        moved_ns = self._move_on_if_late(now_ns())
        self._player.prepare()
        due_ns = self._due_ns
        t_ns = now_ns()
        while t_ns < due_ns:
            t_ns = now_ns()
        moved_ns += self._move_on_if_late(t_ns)
        late_ns = moved_ns + t_ns - self._due_ns
        self._due_ns += self._period_ns
        self._player.send(self._due_ns, late_ns)

    def _move_on_if_late(self, now_ns: int) -> int:
        """Time (ns) by which this period and all later ones move on."""
        late_ns = now_ns - self._due_ns
        if late_ns <= self._latest_ns:
            return 0
        self._player.slip(late_ns / self._period_ns)
        self._due_ns = now_ns
        return late_ns

    def _play_ahead(self, periods: int) -> None:
        """One period, and the next ones, which the hubs send when they are due."""
        hubs, player = self._hubs, self._player
        for hub in hubs:
            hub.keep()
        self._play(0)
        for _ in range(periods - 1):
            if player.phase is _SILENT:
                break
            for hub in hubs:
                hub.later(self._due_ns * 1e-9)
            self._due_ns += self._period_ns
            player.prepare()
            player.send(self._due_ns, 0)
        for hub in hubs:
            hub.hand_over()


class _Asked:
    """Becomes true when this process is asked to end."""

    def __init__(self) -> None:
        self.yes = False
        signal.signal(signal.SIGTERM, self._hear)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the tick ends us, in order

    def _hear(self, _number: int, _frame: Any) -> None:
        self.yes = True


def claimed(names: Sequence[str]) -> bool:
    """Whether this process has all of the names, as long as it lives; waits for those that others have."""
    give_up_s = time.monotonic() + CLAIM_S
    for name in names:
        own = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        while not _bound(own, f"\0{NAME}-{crc32(name.encode()):08x}"):
            if time.monotonic() > give_up_s:
                own.close()
                return False
            time.sleep(0.01)
        own.detach()
    return True


def _bound(own: socket.socket, name: str) -> bool:
    try:
        own.bind(name)
    except OSError:
        return False
    return True


def _port(bus: BusJob) -> Sends:
    if bus.kind == "slcan":
        from drives.ports.slcan_port import SlcanPort

        return SlcanPort(bus.descriptor, bus.name)
    shared = socket.socket(fileno=bus.descriptor)
    return HubSocket(shared, bus.name) if bus.kind == "hub" else FrameSocket(shared, bus.name)


def _replacing(control: socket.socket, ports: Sequence[Sends]) -> Callable[[], None]:
    """Takes what the tick has joined in place of a hub that has ended."""

    def look() -> None:
        with contextlib.suppress(OSError, ValueError):
            text, descriptors, _, _ = socket.recv_fds(control, 16, 1)
            port = ports[int(text)] if text else None
            if descriptors and isinstance(port, FrameSocket):
                port.take(socket.socket(fileno=descriptors[0]))

    return look


def main(job: Job) -> int:
    """The whole process; the exit code."""
    asked = _Asked()
    real_time.name_process(NAME)
    control = socket.socket(fileno=job.control)
    control.setblocking(False)
    if not claimed(sorted({bus.claim for bus in job.buses})):
        return CLAIMED
    memory = Memory(job.axes, job.plans, job.thread)
    ports = [_port(bus) for bus in job.buses]
    wires = [
        BusWire(port, bus.drives, bus.kind != "raw", bus.spindle)
        for port, bus in zip(ports, job.buses, strict=True)
    ]
    player = Player(memory, wires, job.period_s, job.master, job.beat_every)
    hubs = [port for port in ports if isinstance(port, HubSocket)]
    pump = Pump(
        player,
        memory,
        job.period_s,
        hubs if len(hubs) == len(ports) else (),
        _replacing(control, ports),
    )

    def over() -> bool:
        if asked.yes:
            player.finish()
        return (asked.yes or os.getppid() != job.parent) and player.phase is _SILENT

    granted = real_time.prepare(job.priority, awake=False)
    with contextlib.suppress(OSError):
        control.send(json.dumps(granted).encode())
    pump.run(over)
    return 0
