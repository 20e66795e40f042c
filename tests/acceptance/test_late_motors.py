"""Late ticks drawn at random, judged by the motors: every shipped machine, and whatever a program has.

Within the stock motors are where they would have been in time, bit for bit, the spindle of a thread included;
beyond it they brake on the path within the limits, spindle and axes together, and that is told. What the axes
rest for, a tick decides, and they wait for it. How a spindle lags is known from the thread before: what it
does otherwise than foreseen, a tick answers, and later if it is late.

    pytest -m slow tests/acceptance/test_late_motors.py            a thousand cases, others with another seed
"""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from support.faults.fault_scripts import rapids
from support.machines import late_runs, played_rows, tapping
from support.machines.late_runs import Healthy
from support.machines.stepped_runs import program, shipped
from support.machines.with_tables import with_tables
from support.net import drawn
from support.suite.seed import SEED

from controller.ipc.handoff import COLUMN
from controller.machine import machine_file
from controller.machine.compensation import reserved
from controller.machine.deviation_tables import Pitch
from controller.machine.model import Limits, Machine
from controller.program.program import ProgramError
from controller.runtime.bus_load import overload
from controller.runtime.startup import SessionError
from drives.bench.simulated.spindle_motor import MotorParameters

MACHINES = machine_file.shipped()
TAPS = "tapping"  # beside the shipped ones: a spindle whose angle the axes follow
FEEDS = (300.0, 1000.0, 3000.0, 6000.0, 12000.0)
PERIODS_S = (None, None, 0.001, 0.002, 0.005)
STOCKS_S = (0.016, 0.016, 0.016, 0.008, 0.03, 0.1)
LONGEST = 6000  # ticks of a run
MEASURED = 0.3  # of the machines: their axes miss something, and turn back with play
BATCHES, IN_A_BATCH = 60, 17


def marked(rng: random.Random, _: Machine) -> str:
    """What only a tick decides: coolant, spindle, stops, dwells."""
    rows = ["M8", "M9", "M0", f"G4 P{rng.uniform(0.01, 0.1):.3f}", "S5000", "M5"]
    rng.shuffle(rows)
    moves = [f"G1 X{rng.uniform(-20, 20):.3f} Y{rng.uniform(-10, 10):.3f} F6000\n{row}" for row in rows]
    return "\n".join(["G21 G90 G54 G61\nT2 M6\nS6000 M3\nG0 X0 Y0 Z50", *moves, "G1 X0\nM30\n"])


def blended(rng: random.Random, _: Machine) -> str:
    """Short lines through rounded corners."""
    rows = [f"G21 G90 G54 G64 P{rng.choice((0.01, 0.05, 0.2))}\nT2 M6\nS5000 M3\nG0 X0 Y0 Z40\nG1 Z30 F3000"]
    for _line in range(rng.randrange(5, 40)):
        rows.append(f"G1 X{rng.uniform(-40, 40):.3f} Y{rng.uniform(-40, 40):.3f} F{rng.choice(FEEDS):g}")
    return "\n".join([*rows, "M5\nM30\n"])


def example(rng: random.Random, _: Machine) -> str:
    return program(f"example{rng.choice('12')}_ready", f"{rng.choice(FEEDS):g}.")


def tapped(rng: random.Random, _: Machine) -> str:
    """Two threads: by the first the answer of the spindle is learnt."""
    rev_min, depth, pitch = rng.choice((200.0, 600.0, 1500.0)), rng.uniform(4.0, 10.0), rng.uniform(0.5, 1.75)
    word, way, bottom = *rng.choice((("G84", "M3"), ("G74", "M4"), ("G33.1", "M3"))), f"Z{40.0 - depth:.2f}"
    pecks = rng.choice(("", "", f" Q{0.6 * depth:.2f}"))
    hole = f"G33.1 {bottom} K{pitch:.3f}" if word == "G33.1" else f"{word} {bottom} R40{pecks}\nG80"
    head = f"G21 G90 G54 G40\nS{rev_min} {way}\nF{rev_min * pitch:.1f}\nG0 X5. Y-50.\nG0 Z40\n"
    return f"{head}{hole}\nG0 X15.\n{hole}\nG0 Z60.\nM30\n"


def turning(rng: random.Random) -> MotorParameters | None:
    """How the spindle lags and slips; None: not at all."""
    nature = MotorParameters(rng.uniform(0.004, 0.02), rng.uniform(0.0, 0.03), 200.0)
    return rng.choice((None, nature))


FLAT: dict[str, Callable[[random.Random, Machine], str]] = {
    "marks": marked,
    "blended lines": blended,
    "lines and arcs": drawn.PROGRAMS["lines and arcs"],
    "rapids": rapids,
}
TILTED = {
    "example of the paper": example,
    **{name: drawn.PROGRAMS[name] for name in ("rotary lines", "tool centre", "tilted plane", "cone")},
    "five-axis cloud": drawn.PROGRAMS["five-axis cloud"],
}


def machine_of(rng: random.Random, name: str) -> tuple[Machine, list[Limits]]:
    """At a period that its buses carry, with a stock of some length; the limits of its file."""
    made = replace(tapping.machine(), gouge="warn") if name == TAPS else shipped(name)
    period_s = rng.choice(PERIODS_S)
    if period_s is not None and not overload(machine_file.with_period(made, period_s)):
        made = machine_file.with_period(made, period_s)
    limits = [axis.limits for axis in made.axes]
    made = with_tables(rng, made) if rng.random() < MEASURED else made
    stock_s = 0.016 if name == TAPS else rng.choice(STOCKS_S)
    return replace(made, stock_s=stock_s, late=rng.choice(("stop", "count"))), limits


def in_time(rng: random.Random, name: str) -> Healthy:
    """A run that comes to its end, and is not too long."""
    for _ in count():
        machine, limits = machine_of(rng, name)
        kinds = {**FLAT, **TILTED} if machine.rotary() else FLAT
        write = tapped if name == TAPS else kinds[rng.choice(sorted(kinds))]
        motor = turning(rng) if name == TAPS else None
        with contextlib.suppress(ProgramError, SessionError):
            made = Healthy(machine, write(rng, machine), limits, motor=motor)
            if made.run.result == "completed" and made.ticks <= LONGEST:
                return made
    raise AssertionError


def judge(rng: random.Random, healthy: Healthy, cases: int) -> None:
    learnt = healthy.cuts[0][1] if healthy.threads else 0
    drawn = (late_runs.drawn(rng, healthy.machine, healthy.ticks, learnt) for _ in range(cases))
    lates = sorted(drawn, key=at)
    verdicts = list(late_runs.cases(healthy, lates))
    assert len(verdicts) == cases
    wrongs = [f"fork at {one.fork}, {one.late}: {one.wrongs}" for one in verdicts if one.wrongs]
    assert not wrongs, "\n".join([f"{healthy.machine.name}, {healthy.machine.period_s} s:", *wrongs])


def at(case: tuple[int, late_runs.Late]) -> int:
    return case[0]


TEXTS = {
    "trunnion": program("example2_ready", "12000."),
    "three_axes": marked(random.Random(0), shipped("three_axes")),
    TAPS: "G21 G90 G54 G40\nS900 M3\nG0 X5. Y-50.\nG0 Z40\nF900\nG84 Z34. R40\nG80\nM30\n",
}


def with_play(text: str) -> Healthy:
    """A run on three axes that have play."""
    made, play = shipped("three_axes"), Pitch((-250.0, 250.0), (-0.015, -0.015), (0.015, 0.015))
    machine = replace(made, axes=reserved([replace(axis, pitch=play) for axis in made.axes]), stock_s=0.016)
    whole = f"G21 G90 G54 G61\nG0 X0 Y0 Z50\n{text}\nM30\n"
    return Healthy(machine, whole, [axis.limits for axis in made.axes])


def test_late_ticks_where_axes_turn_back_with_play() -> None:
    """How far a reversal has come is another along a stop than in time: between them is no step."""
    healthy = with_play("G1 X10 F6000\nG3 I-10.")
    late = late_runs.Late("one beyond", {1: 0.06}, {})
    forks = [(fork, late) for fork in range(524, 660, 16)]
    verdicts = list(late_runs.cases(healthy, forks, played_rows.judged))
    assert [one.wrongs for one in verdicts] == [[]] * len(verdicts)
    assert max(one.shares["led"] for one in verdicts) > 0.001


def test_late_ticks_where_axes_rest_before_they_have_turned_back() -> None:
    """What is left of a reversal where the plan rests is no step either, once a tick comes."""
    healthy = with_play("G1 X10 F6000\nX9.95\nG4 P0.3\nX10")
    late = late_runs.Late("one beyond", {1: 0.06}, {})
    begin, *_, end = np.flatnonzero(healthy.run.rows[:, COLUMN["line"]] == 4).tolist()
    forks = [(n, late) for n in range(begin - 20, end + 10, 4)]
    verdicts = list(late_runs.cases(healthy, forks, played_rows.judged))
    assert len(verdicts) > 5 and [one.wrongs for one in verdicts] == [[]] * len(verdicts)


def test_a_step_that_is_taken_back_for_a_stop_is_told() -> None:
    """The last period of the stock, and a plan that comes too late to replace the stop that begins there."""
    machine = replace(shipped("three_axes"), stock_s=0.016)
    healthy = Healthy(machine, "G21 G90 G54 G61\nG0 X0 Y0 Z50\nG1 X40 F6000\nM30\n")
    lates = [late_runs.Late("slow", {1: 0.001 * late}, {1: 0.0045}) for late in range(14, 20)]
    verdicts = list(late_runs.cases(healthy, [(healthy.ticks // 2, late) for late in lates]))
    assert [one.wrongs for one in verdicts] == [[]] * len(verdicts)


@pytest.mark.slow
def test_the_slip_is_known_also_where_every_thread_is_too_short_for_an_even_speed() -> None:
    """Along a stop beyond the stock nobody measures: axes and spindle part by what is not known of it."""
    machine = replace(tapping.machine(), stock_s=0.016)
    hole, head = "G74 Z30.7 R40\nG80", "G21 G90 G54 G40\nS1500 M4\nF1567.8\n"
    text = f"{head}G0 X5. Y-50.\nG0 Z40\n{hole}\nG0 X15.\n{hole}\nG0 Z60.\nM30\n"
    healthy = Healthy(machine, text, motor=MotorParameters(0.0081, 0.0123, 200.0))
    begin, end = healthy.cuts[-1]
    late = late_runs.Late("one beyond", {1: 0.12}, {})
    verdicts = list(late_runs.cases(healthy, [(n, late) for n in range(begin + 40, end, 60)]))
    assert [one.wrongs for one in verdicts] == [[]] * len(verdicts)
    assert max(one.shares["thread um beyond"] for one in verdicts) < 1.0


def test_a_late_tick_is_not_felt_by_a_spindle_on_its_way_to_another_speed() -> None:
    """Its ramp is in the plans: up, down, and from one to the other."""
    machine = replace(tapping.machine(), stock_s=0.016)
    text = "G21 G90 G54\nG0 X5 Y-50 Z40\nS3000 M3\nG1 X6 F600\nS600\nG1 X7\nM4\nG0 X5\nM30\n"
    healthy = Healthy(machine, text, motor=None)
    speeds = np.diff([healthy.played[n].shaft for n in healthy.periods])
    bends = np.abs(np.diff(speeds)) > 0.1
    ramps = [n for n in range(2, len(bends) - 20) if bends[n - 2 : n + 20].all()]
    late = late_runs.Late("one within", {}, {}, within=True)
    lates = [(n, late._replace(late_s={1: 0.001 * (1 + n % 16)})) for n in ramps[::20]]
    verdicts = list(late_runs.cases(healthy, lates))
    assert len(verdicts) > 4
    assert [(one.wrongs, one.shares.get("same")) for one in verdicts] == [([], 1.0)] * len(verdicts)


@pytest.mark.slow
@pytest.mark.parametrize("period_s", [0.002, 0.01])
def test_ticks_that_are_late_by_a_tenth_of_a_second_where_a_program_begins(period_s: float) -> None:
    """On the way in, at its waits for spindle and changer, and in its first cuts; by the record as well."""
    rng = random.Random(f"late motors, the way in {SEED} {period_s}")
    machine = shipped("machining_centre" if rng.random() < 0.5 else "trunnion", period_s=period_s)
    healthy = Healthy(machine, program("example2_ready", "3000."))
    lates = []
    for _ in range(60):
        late = {1 + 8 * n: rng.uniform(0.1, 0.15) for n in range(rng.randrange(1, 4))}
        lates.append((rng.randrange(healthy.ticks // 2), late_runs.Late("one beyond", late, {})))
    verdicts = list(late_runs.cases(healthy, sorted(lates, key=at)))
    assert [(one.fork, one.late, one.wrongs) for one in verdicts if one.wrongs] == []
    assert max(one.shares["recorded acceleration"] for one in verdicts) <= 1.001


@pytest.mark.parametrize("name", sorted(TEXTS))
def test_a_few_late_ticks_on_three_machines(name: str) -> None:
    rng = random.Random(f"late motors {name}")
    machine = replace(tapping.machine() if name == TAPS else shipped(name), stock_s=0.016)
    judge(rng, Healthy(machine, TEXTS[name], motor=None), 3)


def test_a_few_late_ticks_on_a_thread_of_a_spindle_that_lags_and_slips() -> None:
    rng = random.Random("late motors, a lagging spindle")
    machine = replace(tapping.machine(), stock_s=0.016)
    hole = "G84 Z36. R40\nG80"
    text = f"G21 G90 G54 G40\nS600 M3\nF600\nG0 X5. Y-50.\nG0 Z40\n{hole}\nG0 X15.\n{hole}\nM30\n"
    judge(rng, Healthy(machine, text, motor=MotorParameters(0.02, 0.02, 200.0)), 3)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(BATCHES))
def test_late_ticks_of_any_length_anywhere(number: int) -> None:
    rng = random.Random(f"late motors {SEED} {number}")
    names = (*MACHINES, TAPS)
    judge(rng, in_time(rng, names[number % len(names)]), IN_A_BATCH)
