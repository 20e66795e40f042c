"""What was planned before is not planned again: neither the law of a window nor its stops."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import pytest
from support.machines import traced_programs
from support.machines.stepped_runs import shipped

from controller import memory
from controller.ipc.handoff import Piece
from controller.machine.kinematics import kinematics_of
from controller.plan import known
from controller.plan.look_ahead import Orders, TrackPlace, Windows
from controller.plan.track import Track

ARC = "G0 X10. Y0.\nG2 F600. X30. Y0. I10. J0.\nG1 X40. Y5.\nM30\n"


def planned(orders: Orders, text: str = ARC) -> list[tuple[tuple[Piece, ...], object]]:
    """Pieces and stops of a program that is read and planned from its beginning, on a machine of its own."""
    machine = shipped()
    kinematics = kinematics_of(machine)
    home = tuple(axis.homing.position for axis in machine.axes)
    track = Track(traced_programs.trace(text, machine, home).items, machine, kinematics)  # type: ignore[arg-type]
    windows, place, found = Windows(machine, kinematics), TrackPlace(0, 0.0), list[Any]()
    while (sent := windows.from_rest(track, place, 0.0, orders)) is not None:
        found.append((sent.pieces, sent.stops))
        place = sent.after
    return found


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often each is worked out."""
    memory.forget()
    count = Counter[str]()
    for module, name in ((known.profile, "plan"), (known.table, "stops")):
        monkeypatch.setattr(module, name, counted(count, name, getattr(module, name)))
    return count


def counted(count: Counter[str], name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    def asked(*given: Any) -> Any:
        count[name] += 1
        return function(*given)

    return asked


def test_the_same_program_is_planned_once_however_often_it_is_read(asked: Counter[str]) -> None:
    first = planned(Orders())
    worked_out = dict(asked)
    assert min(worked_out["plan"], worked_out["stops"]) >= 2
    assert planned(Orders()) == first and dict(asked) == worked_out


def test_another_override_and_another_way_are_planned_anew(asked: Counter[str]) -> None:
    first = planned(Orders())
    worked_out = asked["plan"]
    assert planned(Orders(override=0.5)) != first and asked["plan"] > worked_out
    worked_out = asked["plan"]
    assert planned(Orders(), ARC.replace("X40.", "X41.")) != first and asked["plan"] > worked_out


def test_of_another_program_nothing_is_kept(asked: Counter[str]) -> None:
    planned(Orders())
    worked_out = asked["plan"]
    memory.forget()
    planned(Orders())
    assert asked["plan"] == 2 * worked_out
