"""What the machine shows of itself, by a snapshot."""

from __future__ import annotations

from dataclasses import replace

import pytest
from cutting import shipped

from controller.geometry import Frame
from controller.handoff import Snapshot, SnapshotBoard
from controller.machine import Machine
from controller.service import status
from controller.service.orders import Way
from controller.state import Fault, Mode, sentence


def snapshot(**values: object) -> Snapshot:
    board = SnapshotBoard()
    board.write(*[0] * 54)
    found = board.read()
    assert found is not None
    return found._replace(**{"mode": Mode.READY, **values})  # type: ignore[arg-type]


@pytest.fixture
def machine() -> Machine:
    """The shipped trunnion; its G54 and G55 are at 8 and 30 mm of X."""
    made = shipped()
    frames = (Frame((8.0, 0.0, 0.0)), Frame((30.0, 0.0, 0.0)), *made.offsets[2:])
    return replace(made, offsets=frames)


def way(offset: int) -> Way:
    return Way((0.0, 0.0, 0.0, 0.0, 0.0), 10.0, 0.0, None, "line", offset=offset)


@pytest.mark.parametrize(
    ("offset", "name", "work"), [(None, "G54", -8.0), (0, "G54", -8.0), (1, "G55", -30.0)]
)
def test_the_work_position_is_told_with_the_offset_that_it_is_in(
    offset: int | None, name: str, work: float, machine: Machine
) -> None:
    under_way = None if offset is None else way(offset)
    told = status.machine_values(machine, snapshot(), under_way, None)
    assert told["work_offset"] == name
    assert told["joints"]["X"]["work"] == pytest.approx(work)


def test_what_stands_in_the_way_and_what_stopped_nothing_is_told_in_both_languages(machine: Machine) -> None:
    now = snapshot(interlock=Fault.DOOR_OPEN, warning=Fault.DRIVE_WARNING)
    told = status.machine_values(machine, now, None, None)["notices"]
    assert told == [
        {"name": fault.name, "sentence": sentence(fault), "sentence_de": sentence(fault, language="de")}
        for fault in (Fault.DOOR_OPEN, Fault.DRIVE_WARNING)
    ]
    assert status.machine_values(machine, snapshot(), None, None)["notices"] == []
