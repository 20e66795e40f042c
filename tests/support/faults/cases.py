"""The rows of the fault matrix: how each fault is done, and what the controller must call it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from support.faults.scene import Scene

from controller.state.modes import Fault, Request
from drives import pdo
from drives.bench.virtual.virtual_bus import PORT_LIMIT

AXIS = 1  # Y: the one that faults are done to; it moves in every mode that moves
AHEAD = 100  # counts

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

    def allowed(self, mode: str) -> Named:
        return self.by_mode.get(mode, self.named)


def script(*lines: str) -> Callable[[Scene], None]:
    """Lines of a fault script without their time: at once. ``{ahead}``: a little further on the way of Y."""

    def strike(scene: Scene) -> None:
        servo = scene.drive(AXIS).axis.servo
        ahead = round(servo.position + math.copysign(AHEAD, servo.velocity))
        scene.befall(*(line.format(ahead=ahead) for line in lines))

    return strike


def emcy(code: int) -> Callable[[Scene], None]:
    return lambda scene: scene.drive(AXIS).inject(code, scene.rig.now_s)


def late(seconds: float) -> Callable[[Scene], None]:
    def strike(scene: Scene) -> None:
        scene.late_s = seconds

    return strike


def planner_killed(scene: Scene) -> None:
    scene.kill_planner()


def receive_queue_full(scene: Scene) -> None:
    """More than the port holds has come since the tick last looked."""
    (line,) = scene.group.lines
    nobody = bytes(pdo.frame(pdo.HEARTBEAT + 126, b"\x05"))
    for _ in range(PORT_LIMIT + 10):
        line.port._put(nobody, scene.rig.now_s)  # type: ignore[attr-defined]


def emergency_stop(scene: Scene) -> None:
    scene.request(Request.ESTOP)


def foreign_sync(scene: Scene) -> None:
    """Another node sends SYNC in the middle of each of the next ticks."""
    stranger = scene.bus.connect(lambda _frame, _at_s: None, ())
    T, sync = scene.machine.period_s, bytes(pdo.frame(pdo.SYNC))
    for n in range(5):
        scene.bus.submit(stranger, scene.rig.now_s + (n + 0.5) * T, pdo.SYNC, sync)


def of(*faults: Fault) -> Named:
    return frozenset(faults)


F = Fault


def only(modes: tuple[str, ...], named: Named) -> dict[str, Named]:
    return dict.fromkeys(modes, named)


LOST = of(F.FEEDBACK_LOST)
NOT_THERE = of(F.FOLLOWING_ERROR, F.EMCY)  # the drive's own word for it may come first
UNHEARD = of(F.SETPOINTS_LOST)  # by the deadline of its RPDO, where nothing is seen to be off before
AT_REST = only(("homing", "idle"), NOTHING)  # there it stands, or moves by itself and slowly
SWITCHED = of(N, F.LIMIT_SWITCH, F.FOLLOWING_ERROR, F.STATE_LOST)  # nothing, where it moves the other way

CASES: tuple[Case, ...] = (
    Case("RPDO dropped once", script("drop rpdo Y x 1"), NOTHING),
    Case("RPDO dropped twice", script("drop rpdo Y x 2"), NOTHING),
    Case("RPDO dropped 10 times", script("drop rpdo Y x 10"), of(N, F.FOLLOWING_ERROR)),
    Case("TPDO dropped once", script("drop tpdo Y x 1"), NOTHING),
    Case("TPDO dropped twice", script("drop tpdo Y x 2"), LOST),
    Case("TPDO dropped 10 times", script("drop tpdo Y x 10"), LOST),
    Case("SYNC dropped once", script("drop sync x 1"), NOTHING),
    Case("SYNC dropped twice", script("drop sync x 2"), LOST, all_axes=True),
    Case("SYNC dropped 10 times", script("drop sync x 10"), LOST, all_axes=True),
    Case("RPDO late by 3 ms", script("delay rpdo Y by 3 ms"), NOTHING),
    Case("TPDO late by 3 ms", script("delay tpdo Y by 3 ms"), NOTHING),
    Case("SYNC late by 0.4 ms", script("delay sync by 400 us"), NOTHING),
    Case("RPDO twice", script("duplicate rpdo Y x 5"), NOTHING),
    Case("TPDO twice", script("duplicate tpdo Y x 5"), NOTHING),
    Case("SYNC twice", script("duplicate sync x 5"), NOTHING),
    Case("SYNC twice for 200 ms", script("duplicate sync for 200 ms"), of(F.SYNC_DOUBLED), all_axes=True),
    Case("RPDO in disorder", script("reorder rpdo Y x 1"), NOTHING),
    Case("TPDO in disorder", script("reorder tpdo Y x 1"), NOTHING),
    Case("TPDO corrupted once", script("corrupt tpdo Y x 1"), NOTHING),
    Case("RPDO corrupted 17 times", script("corrupt rpdo Y x 17"), of(F.BUS_ERROR)),
    Case("RPDO corrupted 40 times", script("corrupt rpdo Y x 40"), of(F.BUS_ERROR, F.BUS_OFF)),
    Case("receive queue overflows", receive_queue_full, of(F.RX_OVERFLOW), all_axes=True),
    Case("node silent 100 ms", script("silence Y for 100 ms"), LOST),
    Case("node silent for good", script("silence Y for 900 ms"), LOST),
    Case("node reset", script("node_reset Y"), of(F.NODE_RESET), free=(AXIS,)),
    # What a drive finds inside of itself, where a bus cannot make the cause. Overload and a lost supply can
    # be made: a jammed and a weak motor, and the supply, below.
    Case("drive tells 1000h generic", emcy(0x1000), of(F.EMCY)),
    Case("drive tells 4310h temperature", emcy(0x4310), of(F.EMCY)),
    Case("drive tells 5530h memory", emcy(0x5530), of(F.EMCY)),
    Case("drive tells 6320h parameters", emcy(0x6320), of(F.EMCY)),
    Case("drive tells 7305h encoder", emcy(0x7305), of(F.EMCY)),
    Case("drive tells FF01h of its maker", emcy(0xFF01), of(F.EMCY)),
    # At rest nothing is harmed, nor is a search for the zero that goes on when the motor is free again.
    Case("motor jammed", script("jam Y for 250 ms"), NOT_THERE, AT_REST),
    Case("motor weak", script("weak Y to 1 % for 500 ms"), NOT_THERE, AT_REST),
    Case(
        "RPDO lost for 250 ms",
        script("drop rpdo Y for 250 ms"),
        of(F.FOLLOWING_ERROR),
        only(("homing", "idle"), UNHEARD),
    ),
    Case("heartbeat of the controller lost", script("drop 77F for 400 ms"), of(F.EMCY), all_axes=True),
    Case(
        "RPDO late by 40 ms for good",
        script("delay rpdo Y by 40 ms for 400 ms"),
        of(F.FOLLOWING_ERROR),
        AT_REST,
    ),
    Case(
        "RPDO repeated for 250 ms",
        script("repeat rpdo Y for 250 ms"),
        of(F.FOLLOWING_ERROR),
        AT_REST,
    ),
    Case("limit switch by position", script("limit Y at {ahead} for 250 ms"), SWITCHED),
    Case("limit switch pressed", script("switch Y high for 250 ms"), SWITCHED),
    Case("STO of one drive", script("sto Y for 250 ms"), of(F.TORQUE_OFF), free=(AXIS,)),
    Case(
        "STO of all drives",
        script(*(f"sto {name} for 250 ms" for name in "XYZAC")),
        of(F.TORQUE_OFF),
        free=(0, 1, 2, 3, 4),
        all_axes=True,
    ),
    Case("supply lost", script("power Y for 100 ms"), of(F.NODE_RESET, F.FEEDBACK_LOST), free=(AXIS,)),
    Case("mode by a stranger", script("mode Y to 1"), of(F.MODE_LOST)),
    Case("NMT stop by a stranger", script("nmt Y stop"), of(F.NODE_STOPPED)),
    Case("NMT pre-operational by a stranger", script("nmt Y preop"), of(F.NODE_STOPPED)),
    Case("NMT reset by a stranger", script("nmt Y reset_communication"), of(F.NODE_RESET), free=(AXIS,)),
    Case(  # as long as he goes on, the drive obeys him, too: so he does for two frames only
        "setpoints of a stranger",
        script("foreign rpdo Y data 0F0000000000 x 2"),
        of(F.FOREIGN_FRAMES),
        all_axes=True,
    ),
    Case(  # the voltage is disabled: it coasts
        "a stranger switches off",
        script("foreign rpdo Y for 20 ms"),
        of(F.FOREIGN_FRAMES),
        free=(AXIS,),
        all_axes=True,
    ),
    Case("two drives with one id", script("second Y"), of(F.NODE_TWICE, F.NODE_RESET)),
    Case("wrong statusword: not enabled", script("falsify tpdo Y byte 0 xor 04 x 1"), of(F.STATE_LOST)),
    Case("wrong statusword: in fault", script("falsify tpdo Y byte 0 xor 08 x 1"), of(F.STATE_LOST)),
    Case("node bus-off", script("bus_off Y"), LOST),
    Case("master bus-off", script("bus_off master for 600 ms"), of(F.BUS_OFF)),
    Case("ENOBUFS 5 ms", script("queue_full master for 5 ms"), of(F.SEND_FAILED)),
    Case("ENOBUFS 300 ms", script("queue_full master for 300 ms"), of(F.SEND_FAILED)),
    Case("foreign SYNC", foreign_sync, of(F.SYNC_FOREIGN), all_axes=True),
    Case(
        "babbling node 20 ms",
        script("babble 001 for 20 ms"),
        of(F.BUS_FLOODED),
        all_axes=True,
    ),
    Case(
        "babbling drive 300 ms",
        script("babble emcy Y for 300 ms"),
        of(F.BUS_FLOODED),
        all_axes=True,
    ),
    Case(
        "chattering drive 300 ms",
        script("foreign emcy Y data 0000000000000000 for 300 ms"),
        NOTHING,
    ),
    Case("setpoints taken on arrival", script("write Y 1400:02 to 255"), NOTHING),
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
        # What is queued whole comes to its end.
        only(("jog",), of(N, F.PLANNER_GONE)) | only(("homing", "idle", "hold"), NOTHING),
    ),
)
