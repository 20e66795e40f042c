"""From commissioned drives to a machine that is homed and enabled; the same on every clock."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from controller.ipc.handoff import Arrangement, Outcome, Snapshot
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.messages import Message, TextError, message
from controller.state import stop_times
from controller.state.fault_table import fault_message
from controller.state.modes import Fault, Mode, Request
from drives import commission
from drives.arranged import Arranged
from drives.settings import NodeSettings

HOMING = 6  # mode of operation, 6060h
INPUT_TRIES = 300  # requests that are refused because no input has been heard of yet

Came = tuple[Mode, Fault, int]  # the last: the axis of the fault, by its index; -1 = of none
# Sends a request and lets time pass until the machine is in that mode or in a fault.
Ask = Callable[[Request, float, Mode], Came]


class SessionError(TextError):
    """The machine did not come up, or a part of it is gone: which, and what to do."""


def came_to(now: Snapshot, number: int, request: Request, value: float, wanted: Mode) -> Came | None:
    """Where a request has led, and the fault that forbade or ended it; None while that is open.

    Homing begins and ends in OFF: there it is the axes homed that tell that it is over.
    """
    came, why = now.came_of(number)
    mask = int(value) if request is Request.HOME else 0
    arrived = now.mode is wanted and now.homed & mask == mask
    if came is Outcome.REFUSED:
        return now.mode, why if why is not Fault.NONE else now.fault, now.fault_axis
    is_over = came is Outcome.DONE and (arrived or now.mode is Mode.FAULT)
    return (now.mode, now.fault, now.fault_axis) if is_over else None


def arrangement(machine: Machine, found: Sequence[Arranged]) -> Arrangement:
    """What the tick must know of it."""
    units = {one.name: one.velocity_units for one in found}
    axes = tuple(units.get(axis.name, 1.0) for axis in machine.axes)
    return Arrangement(stop_times.quick_stop_s(machine, found), units.get("spindle", 1.0), axes)


def no_start(machine: Machine, interlock: Fault, untrusted: int) -> Message | None:
    """Why a start is refused; None where nothing of the machine forbids it."""
    if interlock is not Fault.NONE:
        return message("startup.barred", fault=fault_message(interlock))
    if untrusted:
        names = " ".join(axis.name for i, axis in enumerate(machine.axes) if untrusted >> i & 1)
        return message("startup.not_homed", axes=names)
    return None


class StartUp:
    """Commissioning, homing and enabling over SDO and requests."""

    def __init__(
        self,
        machine: Machine,
        networks: Mapping[str, commission.Network],
        ask: Ask,
        homed: Callable[[], int] = lambda: 0,
        arranged: Callable[[tuple[Arranged, ...]], None] = lambda _: None,
    ) -> None:
        """``networks`` by bus name; ``homed``: bit mask of the axes that know where they are;
        ``arranged``: told how the drives were found, each time that they have been commissioned.
        """
        self._machine, self._networks, self._ask, self._homed = machine, networks, ask, homed
        self._arranged = arranged
        self._nodes = machine_file.node_settings(machine)

    def commission(self) -> list[Message]:
        """Write and read back every node's settings and start it. Raises CommissionError.

        What is to be said of everything that is accepted although sheet or drive speak against it.
        """
        master, nodes = machine_file.master_settings(self._machine), machine_file.all_settings(self._machine)
        rates = {bus.name: bus.bit_rate for bus in self._machine.buses}
        found: list[Arranged] = []
        warnings: list[Message] = []
        for name, network in self._networks.items():
            its = [node for node in nodes if node.bus == name]
            for done in commission.commission(network, its, master, bit_rate=rates[name]):
                warnings += [
                    message("sentence", text=commission.of_drive(done, one)) for one in done.warnings
                ]
                if done.arranged is not None:
                    found.append(done.arranged)
        self._arranged(tuple(found))
        return warnings

    def come_up(self) -> None:
        """Home what is not homed yet, group by group, and enable. Raises SessionError.

        The axes of a group home side by side. An absolute encoder is homed from the start.
        """
        axes, homed = self._machine.axes, self._homed()
        self.home([i for i, axis in enumerate(axes) if not homed >> i & 1 and not axis.homing.absolute])
        self._reach(Request.ENABLE, 0.0, Mode.READY)

    def home(self, wanted: Sequence[int], look: Callable[[], None] = lambda: None) -> None:
        """Home the axes of these numbers, group by group; they are off before and after it.

        ``look`` is called before each group, and may raise: then no other one moves. Raises SessionError,
        CommissionError.
        """
        axes = self._machine.axes
        for group in sorted({axes[i].homing.group for i in wanted}):
            look()
            self._home([i for i in wanted if axes[i].homing.group == group])

    def _home(self, axes: Sequence[int]) -> None:
        """Each drive moves itself; what is commanded meanwhile is where it is."""
        nodes = [self._nodes[i] for i in axes]
        for node in nodes:
            self._set_mode(node, HOMING)
        self._reach(Request.HOME, float(sum(1 << i for i in axes)), Mode.OFF)
        for node in nodes:
            self._set_mode(node, node.profile.mode.value)

    def _set_mode(self, node: NodeSettings, mode: int) -> None:
        commission.set_mode(self._networks[node.bus], node, mode)

    def terminals(self, axis: int) -> int | None:
        """What the drive of an axis sees at its terminals; None: it does not say. Raises CommissionError."""
        node = self._nodes[axis]
        return commission.terminals(self._networks[node.bus], node)

    def _reach(self, request: Request, value: float, wanted: Mode) -> None:
        for _ in range(INPUT_TRIES):
            mode, fault, axis = self._ask(request, value, wanted)
            if fault is not Fault.IO_LOST or mode is Mode.FAULT:
                break
        if mode is not wanted or fault is not Fault.NONE:
            modes = {"wanted": wanted.name, "request": request.name, "mode": mode.name}
            raise SessionError(
                message(
                    "startup.not_become", fault=fault_message(fault, self._machine.axis_off(axis)), **modes
                )
            )
