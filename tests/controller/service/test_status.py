"""What the machine shows of itself, by a snapshot."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.stepped_runs import SHIPPED, shipped

from controller.geometry.vectors import Frame, Y, Z
from controller.ipc.handoff import Snapshot, blank
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.program.modal import State
from controller.runtime.plan_messages import POWER_ON, MotionFacts
from controller.service import status
from controller.service.jogging import Stance
from controller.state.modes import ALL_AXES, Fault, Mode, fault_message


def snapshot(**values: object) -> Snapshot:
    return blank()._replace(**{"mode": Mode.READY, **values})  # type: ignore[arg-type]


@pytest.fixture
def machine() -> Machine:
    """The shipped trunnion; its G54 and G55 are at 8 and 30 mm of X."""
    made = shipped()
    frames = (Frame((8.0, 0.0, 0.0)), Frame((30.0, 0.0, 0.0)), *made.offsets[2:])
    return replace(made, offsets=frames)


def way(state: State = POWER_ON) -> MotionFacts:
    return MotionFacts((0.0, 0.0, 0.0, 0.0, 0.0), 10.0, "line", state=state)


def within(frame: Frame) -> State:
    return POWER_ON._replace(modal=replace(POWER_ON.modal, part=frame))


ROTARIES = ((0.0, 0.0), (0.6, -2.0), (-0.9, 0.4))


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("angles", ROTARIES)
def test_the_room_for_a_retract_is_what_the_travel_has_along_the_tool_axis(
    name: str, angles: tuple[float, float]
) -> None:
    """Beside it the line that a jog takes along the same axis, up to the first end of a travel."""
    machine = shipped(name)
    slides = iter((20.0, -30.0, 110.0))
    turns = dict(zip(machine.rotary(), angles, strict=True))
    joints = tuple([turns[i] if i in turns else next(slides) for i in range(5)])
    room = status.retract_room_mm(machine, snapshot(joints=joints, homed=ALL_AXES, at_rest=True))
    line = Stance(machine, kinematics_of(machine), joints, Frame(), ALL_AXES).direction("tool", "Z")
    ends = [
        ((axis.travel_max if d > 0.0 else axis.travel_min) - q) / d
        for axis, q, d in zip(machine.axes, joints, line, strict=True)
        if d
    ]
    assert room is not None and min(ends) - 1.001e-3 <= room <= min(ends)


@pytest.mark.parametrize(
    "values",
    [
        {"mode": Mode.RUNNING},
        {"mode": Mode.OFF},
        {"mode": Mode.FAULT},
        {"mode": Mode.JOG},
        {"at_rest": False},
        {"homed": ALL_AXES & ~4},
        {"untrusted": 4},
        {"mode": Mode.HOLD, "away": True},
    ],
)
def test_no_room_is_told_where_no_retract_is_possible(machine: Machine, values: dict[str, object]) -> None:
    good = {"homed": ALL_AXES, "at_rest": True}
    assert status.retract_room_mm(machine, snapshot(**good)) is not None
    assert status.retract_room_mm(machine, snapshot(**{**good, **values})) is None


@pytest.mark.parametrize(("offset", "name", "work"), [(0, "G54", -8.0), (1, "G55", -30.0)])
def test_the_work_position_is_told_with_the_offset_that_it_is_in(
    offset: int, name: str, work: float, machine: Machine
) -> None:
    state = POWER_ON._replace(modal=replace(POWER_ON.modal, offset=offset))
    told = status.machine_values(machine, snapshot(), None, state)
    assert told["work_offset"] == name
    assert told["joints"]["X"]["work"] == pytest.approx(work)


def test_the_modal_codes_of_the_motion_under_way_are_told(machine: Machine) -> None:
    codes = status.machine_values(machine, snapshot(), None, POWER_ON)["codes"]
    assert codes[:3] == ["G80", "G17", "G21"] and codes[-5:] == ["T1", "H0", "D0", "F0", "S0"]


def test_the_work_position_follows_what_shifts_and_turns_the_coordinates(machine: Machine) -> None:
    turned = Frame((10.0, 0.0, 0.0), Y, (-1.0, 0.0, 0.0), Z)
    told = status.machine_values(machine, snapshot(), None, within(turned))
    joints = {name: told["joints"][name] for name in "XYZ"}
    assert joints["X"]["work"] == pytest.approx(joints["Y"]["machine"])
    assert joints["Y"]["work"] == pytest.approx(10.0 - joints["X"]["machine"])


def test_what_stands_in_the_way_and_what_stopped_nothing_is_told(machine: Machine) -> None:
    now = snapshot(interlock=Fault.DOOR_OPEN, warning=Fault.DRIVE_WARNING, warning_axis=1)
    notices = status.machine_values(machine, now, None, POWER_ON)["notices"]
    door, warning = Fault.DOOR_OPEN, Fault.DRIVE_WARNING
    assert notices == [
        {"name": door.name, **fault_message(door)},
        {"name": warning.name, **fault_message(warning, "Y")},
    ]
    loud = snapshot(warning=Fault.NODE_CHATTERS, warning_axis=-1, chatter_id=0x083, chatter_per_s=2400.4)
    (notice,) = status.machine_values(machine, loud, None, POWER_ON)["notices"]
    assert notice["key"] == "text"
    sender = notice["values"]["text"][0]["values"]["text"][0]
    assert sender["key"] == "frames.of_node"
    assert (sender["values"]["node"], sender["values"]["can_id"], sender["values"]["per_s"]) == (
        3,
        "083",
        2400,
    )
    assert status.machine_values(machine, snapshot(), None, POWER_ON)["notices"] == []


def test_the_programmed_feed_of_a_row_is_that_of_the_line_the_tool_is_on(machine: Machine) -> None:
    row = replace(way(), feed_mm_s=10.0, feed_steps=((0.0, 10.0), (30.0, 25.0), (42.0, 5.0)))
    at = {0.0: 600.0, 29.9: 600.0, 30.0: 1500.0, 50.0: 300.0}
    for s, feed in at.items():
        told = status.machine_values(machine, snapshot(s=s), row, row.state)
        assert told["feed_mm_min"]["programmed"] == feed
