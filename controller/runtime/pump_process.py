"""The process that plays a tick's plans (``drives.pump``), as the tick has it: started, watched, ended."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
from collections.abc import Mapping
from functools import partial
from typing import cast

from controller.machine.model import Machine
from controller.runtime import children
from drives import real_time
from drives.bus import BusError, CanSocket, HubSocket, SlcanPort
from drives.cyclic.group import Group
from drives.ports.port import Port
from drives.pump import process
from drives.pump.player import beat_every
from drives.pump.process import BusJob, Job
from drives.texts import message

READY_S = 30.0  # for it to be there, the end of the one before it included
END_S = 1.0  # for the end of its plan, at rest; then it is killed
STARVED_PERIODS = 2.0

# By which a descriptor is shared. What is none of them comes by a hub, which owns it (service.engine).
_Shared = CanSocket | HubSocket | SlcanPort
_KINDS: dict[type, str] = {CanSocket: "raw", HubSocket: "hub", SlcanPort: "slcan"}


def possible(ports: Mapping[str, Port]) -> bool:
    """Whether all buses can be shared with another process."""
    return all(type(port) in _KINDS for port in ports.values())


class PumpProcess:
    """A running one. Its ``starved_s`` is the loop's."""

    def __init__(self, machine: Machine, group: Group, plans: int, patience_s: float) -> None:
        """``plans``: descriptor of the memory. Call it before this process has privileges."""
        self.starved_s = max(STARVED_PERIODS * machine.period_s, patience_s)
        self._buses = " ".join(bus.name for bus in machine.buses)
        self._control, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with its:
            job = _job(machine, group, plans, its.fileno())
            self._process = subprocess.Popen(
                # -P: a folder of the user's that happens to be named like one of ours is not ours.
                [sys.executable, "-P", "-m", "drives.pump", job.to_text()],
                stdin=subprocess.DEVNULL,
                pass_fds=job.descriptors,
                env=children.environment(),
                process_group=0,
            )
        for n, line in enumerate(group.lines):
            if isinstance(line.port, HubSocket):
                line.port.joined_anew = partial(self._hand, n)

    @property
    def pid(self) -> int:
        return self._process.pid

    def wait_until_ready(self) -> real_time.Granted:
        """The privileges that it was given. Raises BusError where it cannot begin."""
        self._control.settimeout(READY_S)
        with contextlib.suppress(OSError, ValueError):
            granted = real_time.Granted(json.loads(self._control.recv(1024)))
            self._control.setblocking(False)
            return granted
        busy = self._process.poll() == process.CLAIMED
        self.end()
        raise BusError(message("bus.pump_busy" if busy else "bus.no_pump", buses=self._buses))

    def ended(self) -> BusError | None:
        """How it has ended, if it has."""
        return (
            BusError(message("bus.pump_gone", buses=self._buses))
            if self._process.poll() is not None
            else None
        )

    def end(self) -> None:
        """Plays its plan to the end, which at rest is soon; kills it if it does not end."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            children.end(self._process, END_S)

    def _hand(self, bus: int, descriptor: int) -> None:
        """In place of that of a hub that has ended."""
        with contextlib.suppress(OSError):
            socket.send_fds(self._control, [str(bus).encode()], [descriptor])


def _job(machine: Machine, group: Group, plans: int, control: int) -> Job:
    master = group.master
    channels = {bus.name: f"{bus.interface} {bus.channel}" for bus in machine.buses}
    buses = [
        BusJob(
            _KINDS[type(line.port)],
            cast(_Shared, line.port).fileno(),
            line.bus,
            channels[line.bus],
            wire.drives,
            wire.spindle,
        )
        for line, wire in zip(group.lines, group.wires, strict=True)
    ]
    beats = beat_every(machine.period_s, master.heartbeat_s)
    return Job(
        os.getpid(),
        control,
        plans,
        len(machine.axes),
        buses,
        machine.period_s,
        master.node_id,
        beats,
        real_time.PUMP_PRIORITY,
        machine.has_threads,
    )
