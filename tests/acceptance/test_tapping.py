"""Rigid tapping on the stepped clock: the thread that the motors themselves have cut."""

from __future__ import annotations

import numpy as np
import pytest
from support.machines.tapping import Tapper, machine

from controller.ipc.handoff import COLUMN, SETTLED, WAITED
from controller.runtime.events import Event
from controller.state.modes import Fault, Mode, Request
from controller.tick.coupling import Recorded
from controller.tick.cycle import Again
from drives.bench.simulated.spindle_motor import MotorParameters

DEPTH_UM, PITCH_SHARE = 5.0, 0.01  # what must hold
DEPTH_MM = 9.0
LAGGING = MotorParameters(lag_s=0.02, slip=0.02, strongest_rev_s2=200.0)
HEAD = "G21 G90 G54 G40\n"


def tapped(rev_min: float, pitch: float, depth: float = DEPTH_MM, code: str = "G33.1") -> str:
    over, bottom = 40.0, 40.0 - depth
    if code == "G33.1":
        cycle = f"G33.1 Z{bottom} K{pitch}"
    else:
        cycle = f"F{rev_min * pitch}\n{code} Z{bottom} R{over}\nG80"
    way = "M4" if code == "G74" else "M3"
    return f"{HEAD}S{rev_min} {way}\nG0 X5. Y-50.\nG0 Z{over}\n{cycle}\nG0 Z60.\nM30\n"


# ---- depth and pitch ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("rev_min", "pitch", "motor"),
    [
        (800.0, 1.25, None),
        (3000.0, 0.5, LAGGING),
        pytest.param(100.0, 0.5, LAGGING, marks=pytest.mark.slow),
        pytest.param(100.0, 1.25, None, marks=pytest.mark.slow),
    ],
)
def test_depth_and_pitch_are_right_at_every_speed(
    rev_min: float, pitch: float, motor: MotorParameters | None
) -> None:
    tapper = Tapper(motor=motor)
    assert tapper.run(tapped(rev_min, pitch)).result == "completed"
    cut = tapper.cut
    assert abs(cut.way.max() - DEPTH_MM) * 1000.0 < DEPTH_UM
    assert cut.pitch_mm() == pytest.approx(pitch, rel=PITCH_SHARE)
    assert cut.error_um(1.0 / pitch) < DEPTH_UM
    assert cut.turns.max() > 0.0


@pytest.mark.parametrize("seed", range(1))
def test_any_spindle_within_reason_cuts_any_thread(seed: int) -> None:
    rng = np.random.default_rng([18, seed])
    motor = MotorParameters(rng.uniform(0.004, 0.03), rng.uniform(0.0, 0.03), 200.0)
    pitch, rev_min = rng.uniform(0.25, 1.75), float(np.exp(rng.uniform(np.log(100.0), np.log(3000.0))))
    counts = int(rng.integers(2000, 65536))
    made = machine(f"counts_per_rev = {counts}\nposition = {{}}")
    tapper = Tapper(made, motor)
    what = f"seed {seed}: {motor}, pitch {pitch}, {rev_min} 1/min, {counts} counts"
    assert tapper.run(tapped(rev_min, pitch, 6.0)).result == "completed", what
    cut = tapper.cut
    assert abs(cut.way.max() - 6.0) * 1000.0 < DEPTH_UM, what
    assert cut.pitch_mm() == pytest.approx(pitch, rel=PITCH_SHARE), what
    assert cut.error_um(1.0 / pitch) < DEPTH_UM, what


def test_a_left_hand_thread_is_tapped_by_g74_with_the_spindle_turning_back() -> None:
    tapper = Tapper(motor=LAGGING)
    assert tapper.run(tapped(600.0, 1.0, code="G74")).result == "completed"
    assert tapper.cut.error_um(-1.0) < DEPTH_UM
    assert tapper.cut.turns.min() == pytest.approx(-DEPTH_MM, abs=0.01)


def test_pecks_find_the_thread_again() -> None:
    tapper = Tapper(motor=LAGGING)
    program = tapped(600.0, 1.0, code="G84").replace("R40.0", "R40.0 Q5. P0.1")
    assert tapper.run(program).result == "completed"
    cut = tapper.cut
    tops = np.flatnonzero(np.diff(np.sign(np.diff(cut.way))) < 0)
    assert [round(float(cut.way[i])) for i in tops if cut.way[i] > 1.0][:1] == [5]
    assert cut.error_um(1.0) < DEPTH_UM
    assert abs(cut.way.max() - DEPTH_MM) * 1000.0 < DEPTH_UM


@pytest.mark.parametrize("turned", ["I30. J15. K0"])
def test_a_tilted_hole_is_tapped_along_the_tool(turned: str) -> None:
    tapper = Tapper(motor=LAGGING)
    plane = f"G68.2 X0 Y0 Z20. {turned}\nG53.1\nG0 X0 Y0 Z40."
    program = f"{HEAD}S500 M3 F500\n{plane}\nG84 Z30. R38.\nG80\nG69\nM30\n"
    assert tapper.run(program).result == "completed"
    cut = tapper.cut
    assert cut.error_um(1.0) < DEPTH_UM
    assert abs(cut.way.max() - 8.0) * 1000.0 < DEPTH_UM
    rotaries = [i for i, axis in enumerate(tapper.machine.axes) if axis.is_rotary]
    assert np.ptp(cut.joints[:, rotaries], axis=0).max() < 1e-4


@pytest.fixture(scope="module")
def plain() -> Tapper:
    """A thread that nothing disturbs; it is only looked at."""
    tapper = Tapper(motor=LAGGING)
    assert tapper.run(tapped(600.0, 1.0)).result == "completed"
    return tapper


# ---- what disturbs it ---------------------------------------------------------------


def test_neither_override_counts_in_a_thread(plain: Tapper) -> None:
    slowed = Tapper(motor=LAGGING)
    slowed.run(tapped(600.0, 1.0), Event(10, Request.OVERRIDE, 0.5))
    assert len(plain.cut.turns) == pytest.approx(len(slowed.cut.turns), abs=5)


@pytest.mark.parametrize("share", [0.6])
def test_a_hold_stops_on_the_thread_and_goes_on_there(share: float, plain: Tapper) -> None:
    first = next(i for i, now in enumerate(plain.seen) if now.thread_rev)
    at = first + round(share * len(plain.cut.turns))
    held = Tapper(motor=LAGGING)
    run = held.run(tapped(600.0, 1.0), Event(at, Request.HOLD), Event(at + 300, Request.RESUME))
    assert run.result == "completed"
    assert Mode.HOLD in {now.mode for now in held.seen}
    assert held.cut.error_um(1.0) < DEPTH_UM
    assert abs(held.cut.way.max() - DEPTH_MM) * 1000.0 < DEPTH_UM


def test_a_spindle_that_tires_takes_the_axes_along() -> None:
    tapper = Tapper(motor=LAGGING)

    def tire() -> None:
        tapper.spindle.axis.servo.cutting = 100.0 * 4096.0

    tapper.at = {250: tire}
    assert tapper.run(tapped(600.0, 1.0)).result == "completed"
    assert tapper.cut.error_um(1.0) < 10.0 * DEPTH_UM  # one shock of half the torque
    assert abs(tapper.cut.way.max() - DEPTH_MM) * 1000.0 < DEPTH_UM


def test_a_spindle_that_is_stuck_is_told_and_the_axes_rest_where_it_is() -> None:
    tapper = Tapper(motor=LAGGING)
    tapper.at = {300: lambda: tapper.spindle.jam(True, tapper.now_s)}
    run = tapper.run(tapped(600.0, 1.0))
    assert (run.result, run.fault) == ("held", Fault.SPINDLE_LAGS)
    now = tapper.ticks(300)
    assert now.mode is Mode.HOLD and now.at_rest
    assert abs(tapper.cut.way[-1] - tapper.cut.turns[-1]) < 0.005


def test_a_spindle_that_comes_free_again_finishes_its_thread() -> None:
    tapper = Tapper(motor=LAGGING)
    tapper.at = {
        300: lambda: tapper.spindle.jam(True, tapper.now_s),
        800: lambda: tapper.spindle.jam(False, tapper.now_s),
    }
    run = tapper.run(tapped(600.0, 1.0), Event(2500, Request.RESUME))
    assert run.result == "completed"
    assert Fault.SPINDLE_LAGS in {now.fault for now in tapper.seen}
    assert abs(tapper.cut.way.max() - DEPTH_MM) * 1000.0 < DEPTH_UM


def test_every_limit_of_the_axes_holds_and_the_override_is_said_to_be_locked() -> None:
    tapper = Tapper(motor=LAGGING)
    rows = tapper.run(tapped(3000.0, 1.5)).rows
    assert tapper.bench.cycle.modes.fault is Fault.NONE
    assert {now.own_feed for now in tapper.seen if now.thread_rev and now.feed_mm_s > 0.0} == {True}
    assert np.abs(rows[:, COLUMN["thread_mm"]]).max() > 0.0


def test_without_an_angle_a_thread_is_refused_and_g84_floats() -> None:
    made = machine("counts_per_rev = 4096")
    tapper = Tapper(made)
    with pytest.raises(Exception, match="tells its angle"):
        tapper.run(tapped(600.0, 1.0))
    assert tapper.run(tapped(600.0, 1.0, code="G84")).result == "completed"


def test_the_record_of_a_thread_gives_the_same_setpoints_again_whatever_the_spindle_does(
    plain: Tapper,
) -> None:
    """As ``replay`` does: what the spindle made of it comes out of the record, tick by tick."""
    again = Tapper(motor=MotorParameters(0.005, 0.0, 100.0))
    recorded, tick = iter(plain.seen), again.bench.tick

    def as_recorded() -> None:
        if (now := next(recorded, None)) is not None:
            thread = Recorded(now.thread_mm, bool(now.switches & SETTLED))
            again.bench.cycle.again = Again(bool(now.switches & WAITED), Fault.NONE, thread)
        tick()

    again.bench.tick = as_recorded  # type: ignore[method-assign]
    assert again.run(tapped(600.0, 1.0)).result == "completed"
    found = [now.setpoints for now in again.seen[: len(plain.seen)]]
    assert found == [now.setpoints for now in plain.seen[: len(found)]]
    assert len(found) > 2000
