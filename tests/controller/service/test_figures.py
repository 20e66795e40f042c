"""What the figures are, in states drawn at random, beside matrices that know nothing of the product."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.fakes.fake_engine import done, engine_of, served
from support.machines.stepped_runs import SHIPPED
from support.oracles import tilted_planes
from support.oracles.figures_by_matrices import Drawn, mirrored, moved, tip_of
from support.oracles.tilted_planes import Bench, turned_about
from support.suite import seed

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Snapshot, blank
from controller.machine import machine_file, setup_data
from controller.machine.changes import plain_offset
from controller.machine.model import OFFSETS, Joints, Machine, Tool
from controller.plan.report import explained
from controller.program import blocks, carried, modal
from controller.program.carried import InForce
from controller.program.modal import State
from controller.program.program import ProgramError
from controller.runtime.plan_messages import MotionFacts
from controller.service import status, touch_off
from controller.service.command_handlers import CommandHandlers
from controller.state.modes import ALL_AXES, Mode
from controller.store import set_up_store

NAMES = (*SHIPPED, "three_axes", "machining_centre", "xyzac_linuxcnc", "shop")
DIALECTS = ("rs274", "fanuc")
STATES = 48  # of each machine and dialect: 1056 in all
EXACT_MM = 1e-9
LENGTHS = {1: 0.0, 2: 55.05, 3: 120.25, 4: 31.5}


@cache
def bench(name: str) -> Bench:
    return Bench.of(name)


@cache
def bare(name: str, dialect: str) -> Machine:
    made = machine_file.load(name)
    first = made.tools[0]
    tools = tuple(replace(first, number=n, length_mm=length) for n, length in LENGTHS.items())
    return replace(made, dialect=dialect, without_point="unit", tools=tools, changer=None, probe=None)


@dataclass
class Case:
    """A machine as it is fitted, the state in force, the tool in the spindle, and where the axes are."""

    name: str
    machine: Machine
    state: State
    drawn: Drawn
    index: int
    in_spindle: int
    joints: Joints
    end: Joints
    actual: Joints

    def places(self, joints: Joints) -> dict[str, float]:
        return dict(zip((axis.name for axis in self.machine.axes), self.machine.shown(joints), strict=True))

    def work(self, joints: Joints) -> dict[str, float]:
        return self.drawn.work(bench(self.name), self.places(joints))

    @property
    def now(self) -> Snapshot:
        return blank()._replace(
            mode=Mode.READY, homed=ALL_AXES, at_rest=True, joints=self.joints, actual=self.actual
        )


def after(machine: Machine, lines: list[str], begin: State | None = None) -> State:
    seen = InForce()
    for _ in blocks.stream("\n".join(lines).encode(), machine, "p", begin=begin, in_force=seen):
        pass
    assert seen.last is not None
    return carried.after_line(seen.last, machine)


def some(rng: random.Random, name: str, dialect: str) -> Case | None:
    """None where the machine has no such state: its tool axis does not get there."""

    def three(most: float) -> list[float]:
        return [round(rng.uniform(-most, most), 3) for _ in range(3)]

    def on(letters: str, values: Any) -> str:
        return " ".join(f"{letter}{value:.3f}" for letter, value in zip(letters, values, strict=True))

    machine = bare(name, dialect)
    rotaries = [machine.axes[i].name for i in machine.rotary()]
    index, origin = rng.randrange(6), three(100.0)
    turned = rng.choice(([0.0] * 3, [0.0, 0.0, 30.0], three(180.0)))
    shift, by = rng.choice(([0.0] * 3, three(20.0))), {n: round(rng.uniform(-90, 90), 3) for n in rotaries}
    shifted = {n: round(rng.uniform(-90, 90), 3) for n in rotaries} if rng.random() < 0.5 else {}
    offset = {"origin_mm": origin, "turned_deg": turned, "rotary_deg": by}
    machine = setup_data.with_offset(machine, OFFSETS[index], offset)
    suspended = rng.random() < 0.2
    laid = {"origin_mm": shift, "rotary_deg": shifted, "suspended": suspended}
    machine = setup_data.with_shift(machine, "G92", laid)
    inner, lines = moved(np.array(shift) * (not suspended)), ["G21 G90 F100", OFFSETS[index]]
    if dialect == "fanuc" and rng.random() < 0.4:
        local = three(10.0)
        inner = inner @ moved(np.array(local))
        lines.append(f"G52 {on('XYZ', local)}")
    of_tip, length, kind = False, 0.0, rng.choice(("", "turn", "plane"))
    follows = rng.choice(("G254", "G54.2")) if dialect == "fanuc" and rng.random() < 0.4 else ""
    mirror = {n: at for n, at in zip("XYZ", three(30.0), strict=True) if rng.random() < 0.5}
    mirror = mirror if dialect == "fanuc" and rng.random() < 0.4 else {}
    vector, measured = three(30.0), {n: round(rng.uniform(-90, 90), 3) for n in rotaries}
    if follows == "G54.2":
        measured_so = {"origin_mm": vector, "rotary_deg": measured}
        machine = setup_data.with_offset(machine, "G54.2 P1", measured_so)
    if follows:
        lines.append(follows + " P1" * (follows == "G54.2"))
    if kind == "turn":
        x, y, _ = three(40.0)
        angle = round(rng.uniform(-180.0, 180.0), 3)
        lines.append(f"G17 G68 {on('XY', (x, y))} R{angle:.3f}")
        inner = inner @ turned_about(np.array([0.0, 0.0, 1.0]), np.array([x, y, 0.0]), angle)
    elif kind == "plane":
        words = dict(zip("XYZIJK", (*three(30.0), *three(60.0)), strict=True))
        make = tilted_planes.fanuc if dialect == "fanuc" else tilted_planes.linuxcnc
        inner = inner @ make(0, {0: {"Q": 313.0, **words} if dialect == "rs274" else words})
        lines += [f"G68.2 P0 {on('XYZIJK', words.values())}", *(["G53.1"] if dialect == "rs274" else [])]
        of_tip = True
    if mirror:
        lines.append(f"G51.1 {on(''.join(mirror), mirror.values())}")
        inner = inner @ mirrored(mirror)
    if code := rng.choice(("", "G43", "G43", "G43.4", "G43.4")):
        number = rng.choice(list(LENGTHS))
        length, of_tip = LENGTHS[number], of_tip or code == "G43.4"
        lines.append(f"{code} H{number}")
    try:
        state = after(machine, lines)
    except ProgramError:
        return None
    drawn_rotary = {n: by[n] + (0.0 if suspended else shifted.get(n, 0.0)) for n in rotaries}
    drawn = Drawn(
        *(np.array(origin), np.array(turned), inner, drawn_rotary, length, of_tip),
        *(follows, np.array(vector), measured),
    )
    one, end = (
        tuple(rng.uniform(max(a.travel_min, -400.0), min(a.travel_max, 400.0)) for a in machine.axes)
        for _ in range(2)
    )
    actual = tuple(q + rng.uniform(-0.01, 0.01) for q in one)
    return Case(name, machine, state, drawn, index, rng.choice(list(LENGTHS)), one, end, actual)


def cases(name: str, dialect: str, count: int = STATES) -> Iterator[Case]:
    rng, refused = random.Random(f"{seed.SEED} {name} {dialect}"), 0
    print(f"seed {seed.SEED}")
    for _ in range(count):
        while (case := some(rng, name, dialect)) is None:
            refused += 1
        yield case
    assert refused < 4 * count


def close(one: dict[str, float], other: dict[str, float]) -> bool:
    return one.keys() == other.keys() and all(abs(one[n] - other[n]) < EXACT_MM for n in one)


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("name", NAMES)
def test_every_figure_is_what_matrices_make_of_the_joints(name: str, dialect: str) -> None:
    """Work, to go, actual, tip and the tool of the picture, on a way and at rest."""
    for case in cases(name, dialect):
        way = MotionFacts(case.end, 10.0, "line", state=case.state)
        for on_way in (way, None):
            told = status.machine_values(case.machine, case.now, on_way, case.state, case.in_spindle)
            read = {
                key: {axis: row[key] for axis, row in told["joints"].items()}
                for key in ("machine", "work", "to_go", "actual")
            }
            work = case.work(case.joints)
            assert close(read["machine"], case.places(case.joints))
            assert close(read["actual"], case.places(case.actual))
            assert close(read["work"], work), case
            end = case.work(case.end) if on_way else work
            assert close({n: read["work"][n] + read["to_go"][n] for n in end}, end), case
            places, length = case.places(case.joints), LENGTHS[case.in_spindle]
            assert close(told["tip"], case.drawn.tip(bench(name), places, length)), case
            tip, axis = tip_of(bench(name), places, length)
            assert np.abs(np.array(told["on_table"]["tip"]) - tip).max() < EXACT_MM
            assert np.abs(np.array(told["on_table"]["axis"]) - axis).max() < EXACT_MM
            assert told["work_offset"] == OFFSETS[case.index]


def ends_at(case: Case, machine: Machine, state: State, line: str) -> list[float]:
    """The joints as shown where a line leads that is typed there."""
    begun = modal.begun(machine, state)
    read = blocks.stream(line.encode(), machine, "p", start=case.joints, begin=begun)
    *_, last = explained.steps(read, machine, "p", case.joints)
    return [float(last.axes[axis.name]) for axis in machine.axes]


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("name", NAMES)
def test_what_an_axis_is_to_read_it_reads_and_going_there_moves_nothing(name: str, dialect: str) -> None:
    rng = random.Random(f"{seed.SEED} {name}")
    for case in cases(name, dialect, STATES // 4):
        axes = [axis.name for axis in case.machine.axes]
        letters = rng.sample(axes, rng.choice((1, 1, 2)))
        reads = {letter: round(rng.uniform(-30.0, 30.0), 3) for letter in letters}
        offset = touch_off.offset(case.machine, case.state, case.joints, OFFSETS[case.index], reads)
        values = plain_offset(case.machine, offset)
        machine = setup_data.with_offset(case.machine, OFFSETS[case.index], values)
        state = modal.begun(machine, case.state)
        told = status.machine_values(machine, case.now, None, state)["joints"]
        assert close({n: told[n]["work"] for n in axes}, {**case.work(case.joints), **reads}), case
        zero = {letter: 0.0 for letter in "XYZ"}
        offset = touch_off.offset(machine, state, case.joints, OFFSETS[case.index], zero)
        machine = setup_data.with_offset(machine, OFFSETS[case.index], plain_offset(machine, offset))
        there = ends_at(case, machine, case.state, "G0 X0 Y0 Z0")
        assert there == pytest.approx(case.machine.shown(case.joints), abs=1e-8), case


@pytest.mark.parametrize("name", NAMES)
def test_the_length_of_a_tool_is_such_that_its_figure_reads_what_was_given(name: str) -> None:
    """In force under G43, under tip control and in a tilted plane; of a tool that is not, once it is."""
    rng, touched = random.Random(f"{seed.SEED} {name}"), 0
    for case in cases(name, "rs274", STATES // 2):
        number = case.state.length_tool or 3
        state = case.state if case.state.length_tool else after(case.machine, [f"G43 H{number}"], case.state)
        drawn = replace(case.drawn, length=LENGTHS[number])
        now = drawn.work(bench(name), case.places(case.joints))
        wanted = now["Z"] + round(rng.uniform(-30.0, 30.0), 3)
        try:
            tool = touch_off.tool(case.machine, case.state, case.joints, number, {"Z": wanted})
        except CommandRefused:  # Z lies across the tool
            continue
        touched += 1
        tools = tuple(tool if one.number == number else one for one in case.machine.tools)
        machine = replace(case.machine, tools=tools)
        longer = state._replace(modal=replace(state.modal, length_mm=tool.worn.length_mm))
        told = status.machine_values(machine, case.now, None, longer)["joints"]
        assert told["Z"]["work"] == pytest.approx(wanted, abs=1e-8), case
    assert touched > STATES // 4


def worn(tool: Tool) -> Tool:
    return replace(tool, wear_length_mm=-0.05)


def test_touched_off_by_the_service_the_figures_of_its_status_read_so(tmp_path: Path) -> None:
    """Arithmetic, more than now, another tool, a rotary; the length of a tool, which is worn no more."""
    machine = bare("trunnion", "rs274")
    tools = tuple(worn(t) if t.number == 2 else t for t in machine.tools)
    machine = setup_data.with_offset(replace(machine, tools=tools), "G55", [1.0, 2.0, 3.0])
    service = served(tmp_path, machine)
    desk = CommandHandlers(service)
    engine = engine_of(service)
    engine.now = engine.now._replace(joints=(12.0, 100.0, 250.0, 0.0, 0.5), actual=(0.0,) * 5)
    service.set_up.put_in(2)
    service.run.modal.see(after(machine, ["G55", "G43 H2"]))

    def work(axis: str) -> float:
        return float(desk("status", {})["joints"][axis]["work"])

    for typed, reads in (
        ({"Z": 0}, 0.0),
        ({"Z": "5/2"}, 2.5),
        ({"Z": "+0.1"}, 2.6),
        ({"Z": "-(3+1)*2"}, -8.0),
        ({"Z": "+-0,5"}, -8.5),
        ({"Z": "1.5", "X": "10"}, 1.5),
    ):
        done(desk, "set_offset", name="G55", reads=typed)
        assert work("Z") == pytest.approx(reads, abs=1e-9)
    assert work("X") == pytest.approx(10.0)
    done(desk, "set_offset", name="G55", reads={"C": "+1"}, tool=2)
    done(desk, "set_offset", name="G55", reads={"C": 90})
    assert (work("C"), work("Z")) == (pytest.approx(90.0), pytest.approx(1.5))
    done(desk, "set_offset", name="G55", reads={"Z": 0}, tool=3)
    assert work("Z") == pytest.approx(LENGTHS[3] - (LENGTHS[2] - 0.05)), "as under G43 H3 it is 0"
    done(desk, "set_tool", number=2, reads={"Z": "1/4"})
    assert work("Z") == pytest.approx(0.25)
    (row,) = [one for one in setup_data.tools_of(service.set_up.machine) if one["number"] == 2]
    assert row["wear_length_mm"] == 0.0 and row["flute_mm"] == machine.tools[1].flute_mm
    kept = setup_data.applied(service.set_up.file, set_up_store.load(service.state))
    assert kept.tool(2) == service.set_up.machine.tool(2) and kept.offset(1) == service.set_up.machine.offset(
        1
    )


@pytest.mark.parametrize(
    "typed", ["", "low", "1/0", "2 3", "(1", "1)", "__import__('os')", "1e3", "#5", "9" * 9, "+", "--"]
)
def test_what_is_no_figure_is_refused_in_one_sentence(typed: str, tmp_path: Path) -> None:
    desk = CommandHandlers(served(tmp_path, bare("trunnion", "rs274")))
    with pytest.raises(CommandRefused) as why:
        done(desk, "set_offset", name="G54", reads={"Z": typed})
    assert why.value.code == "bad" and why.value.sentence.count(". ") == 0


def test_no_figure_is_set_where_the_axes_have_no_zero(tmp_path: Path) -> None:
    service = served(tmp_path, bare("trunnion", "rs274"))
    engine = engine_of(service)
    engine.now = engine.now._replace(homed=ALL_AXES & ~4)
    for verb, of in (("set_offset", {"name": "G54"}), ("set_tool", {"number": 2})):
        with pytest.raises(CommandRefused, match="Z not homed"):
            done(CommandHandlers(service), verb, reads={"Z": 0}, **of)
