"""Single block, a look aside, and back: at the end of every block, whatever of the program waits there."""

from __future__ import annotations

from functools import cache
from itertools import groupby

import numpy as np
import pytest
from support.machines.spindle_machine import mill
from support.machines.stepped_runs import largest, shipped

from controller.ipc.handoff import Jog, Snapshot, send_jog
from controller.machine import machine_file
from controller.machine.model import Joints, Machine
from controller.runtime import checked
from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Fault, Mode, Request

PERIOD_S = 0.01
MOST = 2000  # ticks from one standstill to the next
UP: Joints = (0.0, 0.0, 1.0, 0.0, 0.0)
ASIDE_MM = 2.99
# Behind most motions one or more words wait that take no time, up to the end of the program.
TEXT = """G21 G90 G54 T2 M6
S3000 M3
G0 X5. Y0. Z120.
G1 X8. F2000.
S2000 M3
M0
G1 X6.
G4 P0.05
M8
G1 X5.
M5
M9
M30
"""
MACHINES = {"no spindle": shipped, "spindle": mill}


class Operator:
    """Goes through the program block by block; what was seen is kept."""

    def __init__(self, made: Machine) -> None:
        self.stepped = SteppedMachine(machine_file.with_period(made, PERIOD_S))
        self.stepped.come_up()
        self.stepped.request(Request.SINGLE_BLOCK, 1.0)
        self.stepped.go(3)
        task = checked.task(TEXT.encode(), "part.ngc", self.stepped.machine)
        self.stepped.begin(checked.path_of(task))
        self.lines: list[int] = []  # at which it was held
        self.told: list[tuple[float, int]] = []  # speed of the spindle and coolant
        self.joints: list[Joints] = []
        self.stands(3)

    @property
    def now(self) -> Snapshot:
        found = self.stepped.board.read()
        assert found is not None
        return found

    @property
    def mode(self) -> Mode:
        return self.stepped.cycle.modes.mode

    def _see(self) -> bool:
        peripherals, follow = self.stepped.cycle.peripherals, self.stepped.cycle.follow
        self.told.append((peripherals.rev_min, peripherals.coolant))
        self.joints.append(follow.joints)
        return follow.at_rest and not follow.stopping and self.mode not in (Mode.RUNNING, Mode.JOG)

    def stands(self, first: int) -> None:
        """After ``first`` ticks, until nothing moves any more."""
        self.stepped.go(first, lambda: self._see() and False)
        self.stepped.go(MOST, self._see)
        assert self.mode in (Mode.HOLD, Mode.READY), self.stepped.cycle.modes.fault

    def resume(self) -> None:
        self.stepped.request(Request.RESUME)
        self.stands(3)

    def jog(self) -> None:
        send_jog(self.stepped._operator, Jog(UP, 50.0, ASIDE_MM), next(self.stepped._numbers))
        self.stands(3)

    def lead(self, back: bool) -> None:
        """As the service does it: planned, and gone when the tick has it."""
        planner = self.stepped.planner
        if back:
            planner.go_back(self.now)
        else:
            planner.retract(self.now, ASIDE_MM)
        self.stepped.go(50, lambda: planner.is_path_accepted(self.now))
        self.resume()

    def all_of_it(self, look: str, pause: int = 0) -> None:
        """``look``: by "jog" or "retract", once at each hold; ``pause``: ticks before the way back."""
        while self.mode is Mode.HOLD:
            line = self.now.line
            if look and line not in self.lines:
                held, told = self.stepped.joints, self.told[-1]
                if look == "jog":
                    self.jog()
                else:
                    self.lead(back=False)
                assert self.stepped.joints[2] == pytest.approx(held[2] + ASIDE_MM)
                self.stepped.go(pause)
                self.lead(back=True)
                over = self.stepped.joints
                assert self.mode is Mode.HOLD and over[2] > held[2] - 1e-9
                assert over[:2] + over[3:] == pytest.approx(held[:2] + held[3:], abs=1e-9)
                assert self.told[-1] == told, "nothing of the program is done aside"
                self.stepped.go(5)
                assert self.stepped.planner.aside is None
            self.lines.append(line)
            assert len(self.lines) < 40
            self.resume()


def seen(values: list[object]) -> list[object]:
    """Without what comes again at once: a pause at which the tool was aside is begun anew."""
    return [value for value, _ in groupby(values)]


@cache
def undisturbed(name: str) -> Operator:
    plain = Operator(MACHINES[name]())
    plain.all_of_it("")
    return plain


@pytest.mark.parametrize(
    ("name", "look", "pause"),
    [
        ("no spindle", "jog", 1),
        ("spindle", "jog", 2),
        ("spindle", "retract", 1),
    ],
)
def test_a_look_aside_at_the_end_of_any_block_leaves_nothing_out_and_breaks_no_limit(
    name: str, look: str, pause: int
) -> None:
    plain, done = undisturbed(name), Operator(MACHINES[name]())
    done.all_of_it(look, pause)
    assert plain.mode is done.mode is Mode.READY and done.now.fault is Fault.NONE
    assert len(plain.lines) > 10 and seen([*done.lines]) == seen([*plain.lines])
    assert seen([*done.told]) == seen([*plain.told])
    assert done.stepped.joints == plain.stepped.joints
    first, second, third = largest(np.array(done.joints), done.stepped.machine)
    assert first <= 1.0005 and second <= 1.002 and third <= 1.02
