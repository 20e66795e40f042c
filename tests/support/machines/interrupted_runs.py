"""Programs interrupted on the stepped machine and gone on with, for the tests of restarts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from support.machines.stepped_runs import Cut, largest, off_the_path, program, shipped

from controller.ipc.handoff import COLUMN, STOOD
from controller.machine.kinematics import Kinematics, kinematics_of
from controller.machine.model import Joints, Machine, Tool
from controller.plan.path import path
from controller.plan.restart import restart
from controller.plan.restart.program_position import ENTRY_ID, Spot
from controller.plan.restart.restart import Rest, Source
from controller.plan.segment import ContinuousPath, PathItem, Segment
from controller.plan.surfaces import choices
from controller.program import blocks
from controller.runtime.events import Event
from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Mode, Request
from controller.verify import trace

VELOCITY, ACCELERATION, JERK = 1.0005, 1.002, 1.02
LONG = 200_000  # ticks: whatever is waited for has come by then

EXAMPLE_2 = program("example2_ready.ngc", "1000.")
LINES = """G21 G90 G54 G61 T2 M6
S8000 M3 M8
G0 X0. Y0. Z60.
G1 Z20. F1500.
G1 X10. Y5. A3.
G2 X20. Y-5. I10. J0.
G4 P0.2
G1 X0. Y0. C20.
G0 Z80.
M5 M9
M30
"""
ROWS = [
    f"X{2 + 0.8 * k:.3f} Y{3 * np.sin(0.3 * k):.3f} Z{20 + np.cos(0.2 * k):.3f} A{10 * np.sin(0.1 * k):.3f}"
    for k in range(60)
]
TIPS = f"""G21 G90 G54 G64 P0.02 Q0.1 T1 M6
S8000 M3
G43.4
G0 X0. Y0. Z30. A0. C0.
G1 X1. Y0. Z20. F1200.
{chr(10).join(ROWS)}
G49
G0 Z130.
M30
"""


@dataclass
class Items:
    """A path for ``SteppedMachine.run``."""

    items: Iterable[PathItem]


def source(text: str, machine: Machine, dry_run_mm: float = 0.0, start: Joints | None = None) -> Source:
    """The program from ``start``, with the choices of a check; None: from the homed position, as checked."""
    kinematics, read = kinematics_of(machine), blocks.read(text.encode(), machine, "part.ngc").blocks
    homed = tuple([axis.homing.position for axis in machine.axes])
    chosen = choices.choices(read, machine, kinematics, homed, "part.ngc")
    again = lambda: read  # noqa: E731
    return Source(read, "part.ngc", machine, kinematics, start or homed, chosen, dry_run_mm, again=again)


def segments(
    text: str, machine: Machine, start: Joints | None = None, in_spindle: int | None = None
) -> dict[int, Segment]:
    """All motions of the whole program, by motion id; ``start``: where it begins, None: homed.

    ``in_spindle``: a changer does not fetch a tool that is there; None: it fetches all.
    """
    if in_spindle is not None:
        machine = replace(machine, in_spindle=in_spindle)
    asked = source(text, machine, start=start)
    tracer = path.PathBuilder(asked.name, machine, asked.kinematics, asked.start, asked.chosen or {})
    chains = [item for item in tracer.items(asked.blocks) if isinstance(item, ContinuousPath)]
    return dict(enumerate(segment for chain in chains for segment in chain.segments))


@cache
def up(name: str = "trunnion") -> SteppedMachine:
    """A machine that has come up; a finished program leaves it ready for the next one."""
    made = SteppedMachine(shipped(name))
    made.come_up()
    return made


def fresh(machine: Machine | None = None) -> SteppedMachine:
    made = SteppedMachine(machine or shipped())
    made.come_up()
    return made


def rest_of(text: str, spot: Spot, machine: Machine, start: Joints | None = None) -> Rest:
    """``start``: where the whole run began that the spot is of; None: from the homed position."""
    return restart.find(source(text, machine, start=start), spot)


def resumed(stepped: SteppedMachine, rest: Rest, events: Sequence[Event] = (), in_spindle: int = 1) -> Cut:
    """The rest, entered from where the machine stands."""
    run = stepped.run(Items(rest.entered(stepped.joints, in_spindle)), events)
    made = trace.from_rows(run.rows, stepped.machine, stepped.kinematics, stepped.planner.segments)
    return Cut(stepped, run, made, run.rows[len(run.rows) - len(made.time_s) :])


def program_rows(rows: np.ndarray) -> np.ndarray:
    """Those on motions of the program itself."""
    ids = rows[:, COLUMN["motion_id"]]
    return rows[(ids >= 0) & (ids < ENTRY_ID)]


def distance(rows: np.ndarray, wanted: dict[int, Segment], kinematics: Kinematics) -> float:
    """Largest distance (mm, or rad of the rotaries) of commanded joints from the program's."""
    first, far = COLUMN["joint_command_0"], 0.0
    for row in program_rows(rows):
        joints = tuple([float(q) for q in row[first : first + len(kinematics.order)]])
        near = kinematics.rotaries(joints)
        there = wanted[int(row[COLUMN["motion_id"]])].motion.joints(float(row[COLUMN["s"]]), near, kinematics)
        assert there is not None
        far = max(far, float(np.abs(np.subtract(there, joints)).max()))
    return far


def assert_rest_is_cut(rows: np.ndarray, wanted: dict[int, Segment], spot: Spot) -> None:
    """From the spot on every feed motion of the program is gone through to its end, in order; the rest of one
    that leads off is passed over.
    """
    mine = program_rows(rows)
    ids, s = mine[:, COLUMN["motion_id"]].astype(int), mine[:, COLUMN["s"]]
    stood = mine[1:, COLUMN["switches"]].astype(int) & STOOD != 0  # what no drive has used is taken back
    onward = ~stood & (np.diff(ids) == 0)
    assert (np.diff(ids)[~stood] >= 0).all() and (np.diff(s)[onward] >= -1e-9).all()
    for number, segment in wanted.items():
        begun = number > spot.motion_id or (number == spot.motion_id and spot.s < segment.motion.end - 1e-3)
        begun = begun and (number, segment.name) != (spot.motion_id, "lead out")
        if spot.motion_id < 0:  # a pause, behind a rapid that is not gone through in part
            begun = segment.place.line >= spot.line
        leaves = number == spot.motion_id and segment.name == "lead out"  # the rest begins behind it
        if segment.feed_mm_s is None or not begun or leaves:
            continue
        gone = s[ids == number]
        assert len(gone), (number, segment.name)
        # The last step runs on into the next motion, and is longer yet where the rest still speeds up.
        step = max(2.0 * float(np.diff(gone).max()) if len(gone) > 1 else 0.0, 0.05)
        begin = spot.s if number == spot.motion_id else 0.0
        assert gone[0] <= begin + step and gone[-1] >= segment.motion.end - step, (number, segment.name)


def assert_in_limits(joints: np.ndarray, machine: Machine, label: object) -> None:
    first, second, third = largest(joints, machine)
    assert first <= VELOCITY and second <= ACCELERATION and third <= JERK, (label, first, second, third)


def assert_sound(done: Cut, label: object) -> None:
    """On the path, in the limits, to the end."""
    assert done.run.result == "completed", (label, done.run.fault_text)
    far_mm, turned_deg = off_the_path(done)
    assert far_mm < 1e-6 and turned_deg < 1e-6, label
    assert_in_limits(done.joints, done.machine, label)


def until(stepped: SteppedMachine, *modes: Mode) -> np.ndarray:
    """Time passes until the machine stands in one of these modes."""
    cycle = stepped.cycle
    rows = stepped.go(LONG, lambda: cycle.modes.mode in modes and cycle.follow.at_rest)
    assert cycle.modes.mode in modes, stepped.fault_text
    return np.concatenate([rows, stepped.go(20)])


def along(stepped: SteppedMachine) -> np.ndarray:
    """The way that the planner was asked for is told, gone along, and held at its end."""
    rows = stepped.go(2000, lambda: stepped.planner.is_path_accepted(stepped.board.read()))  # type: ignore[arg-type]
    stepped.request(Request.RESUME)
    return np.concatenate([rows, stepped.go(5), until(stepped, Mode.HOLD)])


def with_tool(machine: Machine, number: int, **changes: float) -> Machine:
    def changed(tool: Tool) -> Tool:
        return replace(tool, **changes) if tool.number == number else tool  # type: ignore[arg-type]

    return replace(machine, tools=tuple(changed(tool) for tool in machine.tools))
