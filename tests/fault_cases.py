"""The rows of the fault matrix: how each fault is done, and what the controller must call it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from fault_scene import Scene

from controller.state import Fault, Request
from drives import pdo
from drives.simulated.inputs import POSITIVE_LIMIT, STO
from drives.virtual.fault_script import MASTER, Action, Injection, parse
from drives.virtual.stepped_port import PORT_LIMIT, SYNC_FRAME

AXIS = 1  # Y: the one that faults are done to; it moves in every mode that moves

N = Fault.NONE
Named = frozenset[Fault]
NOTHING = frozenset({N})


class Case(NamedTuple):
    """``named``: what the machine may call it, N = it goes on; ``by_mode`` where a mode differs."""

    name: str
    strike: Callable[[Scene], None]
    named: Named
    by_mode: Mapping[str, Named] = {}
    free: tuple[int, ...] = ()  # axes without torque: no promise about when they stand
    all_axes: bool = False  # any may be named
    loses: int = 0  # frames in a row that the drives do without: steps of so many more are theirs

    def allowed(self, mode: str) -> Named:
        return self.by_mode.get(mode, self.named)


def script(line: str) -> Callable[[Scene], None]:
    """A line of a fault script without its time: at once. ``{n}`` is the node of the axis."""

    def strike(scene: Scene) -> None:
        node = scene.machine.axes[AXIS].node
        scene.injector.add(parse("at 0 s: " + line.format(n=node)))

    return strike


def emcy(code: int) -> Callable[[Scene], None]:
    return lambda scene: scene.drive(AXIS).inject(code, scene.rig.now_s)


def late(seconds: float) -> Callable[[Scene], None]:
    def strike(scene: Scene) -> None:
        scene.late_s = seconds

    return strike


def planner_killed(scene: Scene) -> None:
    scene.planner_dead = True


def receive_queue_full(scene: Scene) -> None:
    """More than the port holds has come since the tick last looked."""
    (line,) = scene.group.lines
    nobody = bytes(pdo.frame(pdo.HEARTBEAT + 126, b"\x05"))
    for _ in range(PORT_LIMIT + 10):
        line.port._put(nobody, scene.rig.now_s)  # type: ignore[attr-defined]


def emergency_stop(scene: Scene) -> None:
    scene.request(Request.ESTOP)


def torque_off(scene: Scene) -> None:
    scene.drive(AXIS).axis.inputs.set(STO, scene.rig.now_s)


def torque_off_all(scene: Scene) -> None:
    for drive in scene.rig.drives.values():
        drive.axis.inputs.set(STO, scene.rig.now_s)


def limit_switch(scene: Scene) -> None:
    drive = scene.drive(AXIS)
    drive.axis.inputs.set(POSITIVE_LIMIT, scene.rig.now_s)
    drive.inject(0x8612, scene.rig.now_s)


def foreign_sync(scene: Scene) -> None:
    """Another node sends SYNC in the middle of each of the next ticks."""
    stranger = scene.bus.connect(lambda _frame, _at_s: None, ())
    T = scene.machine.period_s
    for n in range(5):
        scene.bus.submit(stranger, scene.rig.now_s + (n + 0.5) * T, pdo.SYNC, SYNC_FRAME)


def queue_full(seconds: float) -> Callable[[Scene], None]:
    def strike(scene: Scene) -> None:
        scene.injector.add(Injection(Action.QUEUE_FULL, node=MASTER, duration_s=seconds))

    return strike


def of(*faults: Fault) -> Named:
    return frozenset(faults)


F = Fault


def only(modes: tuple[str, ...], named: Named) -> dict[str, Named]:
    return dict.fromkeys(modes, named)


LOST = of(F.FEEDBACK_LOST)

CASES: tuple[Case, ...] = (
    Case("RPDO dropped once", script("drop rpdo {n} x 1"), NOTHING, loses=1),
    Case("RPDO dropped twice", script("drop rpdo {n} x 2"), NOTHING, loses=2),
    Case("RPDO dropped 10 times", script("drop rpdo {n} x 10"), of(N, F.FOLLOWING_ERROR), loses=10),
    Case("TPDO dropped once", script("drop tpdo {n} x 1"), NOTHING),
    Case("TPDO dropped twice", script("drop tpdo {n} x 2"), LOST),
    Case("TPDO dropped 10 times", script("drop tpdo {n} x 10"), LOST),
    Case("SYNC dropped once", script("drop sync x 1"), NOTHING, loses=1),
    Case("SYNC dropped twice", script("drop sync x 2"), LOST, loses=2, all_axes=True),
    Case("SYNC dropped 10 times", script("drop sync x 10"), LOST, loses=2, all_axes=True),
    Case("RPDO late by 3 ms", script("delay rpdo {n} by 3 ms"), NOTHING, loses=2),
    Case("TPDO late by 3 ms", script("delay tpdo {n} by 3 ms"), NOTHING),
    Case("SYNC late by 0.4 ms", script("delay sync by 400 us"), NOTHING, loses=1),
    Case("RPDO twice", script("duplicate rpdo {n} x 5"), NOTHING),
    Case("TPDO twice", script("duplicate tpdo {n} x 5"), NOTHING),
    Case("SYNC twice", script("duplicate sync x 5"), NOTHING),
    Case("RPDO in disorder", script("reorder rpdo {n} x 1"), NOTHING, loses=2),
    Case("TPDO in disorder", script("reorder tpdo {n} x 1"), NOTHING),
    Case("TPDO corrupted once", script("corrupt tpdo {n} x 1"), NOTHING),
    Case("RPDO corrupted 17 times", script("corrupt rpdo {n} x 17"), of(F.BUS_ERROR), loses=2),
    Case("RPDO corrupted 40 times", script("corrupt rpdo {n} x 40"), of(F.BUS_ERROR, F.BUS_OFF), loses=2),
    Case("receive queue overflows", receive_queue_full, of(F.RX_OVERFLOW), all_axes=True),
    Case("node silent 100 ms", script("silence {n} for 100 ms"), LOST),
    Case("node silent for good", script("silence {n} for 900 ms"), LOST),
    Case("node reset", script("node_reset {n}"), of(F.NODE_RESET), free=(AXIS,)),
    Case("EMCY 1000h generic", emcy(0x1000), of(F.EMCY)),
    Case("EMCY 2310h current", emcy(0x2310), of(F.EMCY)),
    Case("EMCY 3220h voltage", emcy(0x3220), of(F.EMCY)),
    Case("EMCY 4310h temperature", emcy(0x4310), of(F.EMCY)),
    Case("EMCY 5530h hardware", emcy(0x5530), of(F.EMCY)),
    Case("EMCY 6320h software", emcy(0x6320), of(F.EMCY)),
    Case("EMCY 7305h encoder", emcy(0x7305), of(F.EMCY)),
    Case("EMCY 8130h heartbeat", emcy(0x8130), of(F.EMCY)),
    Case("EMCY 8250h protocol", emcy(0x8250), of(F.EMCY)),
    Case("EMCY FF01h vendor", emcy(0xFF01), of(F.EMCY)),
    Case("following error", emcy(0x8611), of(F.FOLLOWING_ERROR)),
    Case("limit switch", limit_switch, of(F.LIMIT_SWITCH)),
    Case("STO of one drive", torque_off, of(F.TORQUE_OFF), free=(AXIS,)),
    Case("STO of all drives", torque_off_all, of(F.TORQUE_OFF), free=(0, 1, 2, 3, 4), all_axes=True),
    Case("wrong statusword: not enabled", script("falsify tpdo {n} byte 0 xor 04 x 1"), of(F.STATE_LOST)),
    Case("wrong statusword: in fault", script("falsify tpdo {n} byte 0 xor 08 x 1"), of(F.STATE_LOST)),
    Case("node bus-off", script("bus_off {n}"), LOST),
    Case("master bus-off", script("bus_off master for 600 ms"), of(F.BUS_OFF)),
    Case("ENOBUFS 5 ms", queue_full(0.005), of(F.SEND_FAILED)),
    Case("ENOBUFS 300 ms", queue_full(0.3), of(F.SEND_FAILED)),
    Case("foreign SYNC", foreign_sync, of(F.SYNC_FOREIGN), all_axes=True),
    Case(
        "babbling node 20 ms",
        script("babble 001 for 20 ms"),
        of(F.FEEDBACK_LOST, F.SEND_FAILED),
        loses=2,
        all_axes=True,
    ),
    Case("emergency stop asked for", emergency_stop, of(F.EMERGENCY_STOP)),
    Case("tick late 5 ms", late(0.005), NOTHING),
    Case("tick late 50 ms", late(0.050), of(N, F.TOO_MANY_SKIPS)),
    Case(
        "tick late 500 ms",
        late(0.500),
        of(F.TOO_MANY_SKIPS),
        all_axes=True,
    ),
    Case(
        "planner killed",
        planner_killed,
        of(F.PLANNER_GONE),
        {"jog": of(N, F.PLANNER_GONE)} | only(("homing", "idle", "hold"), NOTHING),
    ),
)
