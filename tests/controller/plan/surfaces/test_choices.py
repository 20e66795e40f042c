"""Branch and turns over whole programs, and what is said where no turn fits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from support.machines.planned_laws import laws_of
from support.machines.traced_programs import HOME, assert_whole, mill, named, segments, trace
from support.parts.nurbs_text import blade, nurbs
from support.parts.random_surfaces import compound, text

from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.motion.motions import Rotaries
from controller.plan.context import Context
from controller.plan.path.path import stream
from controller.plan.segment import ContinuousPath, Path, rotaries_of
from controller.plan.surfaces import auto, legs, train
from controller.plan.surfaces.choices import choices
from controller.program import blocks
from controller.program.program import Block, CutCone, CutRuled, ProgramError

CONE = "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D{} F100.\n"


def with_travel(built: Machine, low: float, high: float) -> Machine:
    """The machine with another travel of C, degrees."""
    axes = list(built.axes)
    axes[4] = replace(axes[4], travel_min=math.radians(low), travel_max=math.radians(high))
    return replace(built, axes=tuple(axes))


def wall(x: float, lean_deg: float, line: str = " F600.") -> str:
    """A straight wall along X at ``x`` whose ruling leans 3 mm on 10 towards an angle about Z."""
    dx, dy = 3.0 * math.cos(math.radians(lean_deg)), 3.0 * math.sin(math.radians(lean_deg))
    rows = [f"X{x + 10.0 * k + dx:.4f} Y{dy:.4f} Z10." for k in range(4)]
    rows += [f"X{x + 10.0 * k:.4f} Y0. Z0." for k in range(4)]
    return "\n".join([f"G52 {rows[0]}{line}", *rows[1:]]) + "\n"


def of(text: str, built: Machine) -> dict[int, tuple[float, float]]:
    program = blocks.read(text.encode(), built, "part.ngc")
    return choices(program.blocks, built, kinematics_of(built), HOME, "part.ngc")


def rotary_travel(path: Path) -> float:
    """Degrees that both rotaries turn over a path whose cuts turn evenly."""
    ends = np.array([[s.start, s.end] for s in segments(path)])[:, :, 3:]
    return float(np.degrees(np.abs(ends[:, 1] - ends[:, 0]).sum()))


def test_the_choices_are_where_the_trains_begin() -> None:
    built = mill(gouge="warn")
    text = wall(0.0, 40.0) + "G0 Z250.\n" + wall(60.0, -130.0)
    found, path = of(text, built), trace(text, built)
    assert list(found) == [1, 10]
    for start, cut in zip(found.values(), named(path, "cut"), strict=True):
        assert cut.start[3:] == pytest.approx(start, abs=1e-9)
    assert_whole(path, built)


@pytest.mark.parametrize("leans", [(40.0, -130.0, 60.0), (85.0, 100.0, 130.0), (-95.0, -85.0, 89.0)])
def test_the_program_turns_no_farther_than_with_any_other_branches(leans: tuple[float, ...]) -> None:
    built, kinematics = mill(gouge="warn"), kinematics_of(mill())
    text = "".join(wall(60.0 * k, lean) for k, lean in enumerate(leans)) + "G0 A0. C0.\n"
    path = trace(text, built)
    least = math.inf
    for code in range(2 ** len(leans)):
        now, total = (0.0, 0.0), 0.0
        for bit, block in enumerate(blocks.read(text.encode(), built, "part.ngc").blocks[:-1]):
            (cut,) = auto.build([block], Context.silent(built))
            ways = legs.options(legs.Fields([cut], kinematics), Context.silent(built), now)
            start = ways[code >> bit & 1].way.start
            total += abs(start[0] - now[0]) + abs(start[1] - now[1])
            now = start
        least = min(least, math.degrees(total + abs(now[0]) + abs(now[1])))
    assert rotary_travel(path) == pytest.approx(least, abs=1e-6)


@pytest.mark.parametrize("name", ["trunnion", "head_head", "table_head"])
def test_no_cut_is_slower_than_on_another_branch_that_fits(name: str) -> None:
    """As it is planned, and with the rotaries led to either branch; those of these two heads are alike."""
    built = replace(machine_file.load(name), gouge="warn")
    silent = Context.silent(built, "part.ngc")
    kinematics, now = kinematics_of(built), tuple(axis.homing.position for axis in built.axes)
    near, apart = rotaries_of(now, kinematics), 0
    for seed in range(2):
        read = blocks.read(text(compound(seed, 1), 9000.0).encode(), built, "part.ngc")
        cuts = list(auto.build([next(b for b in read.blocks if isinstance(b, CutRuled))], silent))
        order = cuts[0].block.place.order

        def cut_s(chosen: dict[int, Rotaries], blocks: Sequence[Block] = read.blocks) -> float:
            items = stream(blocks, "part.ngc", built, kinematics, now, chosen)
            (chain,) = (
                i for i in items if isinstance(i, ContinuousPath) and any(s.name == "cut" for s in i.segments)
            )
            laws = zip(chain.segments, laws_of(chain.segments, built), strict=True)
            return sum(law.duration_s for segment, law in laws if segment.name == "cut")

        options = legs.options(legs.Fields(cuts, kinematics), silent, near)
        starts = [one.way.start for one in options if one.way.inside and any(one.way.shifts(built, near))]
        every = [cut_s({order: start}) for start in starts]
        taken = cut_s(choices(read.blocks, built, kinematics, now, "part.ngc"))
        assert taken <= 1.04 * min(every), f"seed {seed}"
        apart += max(every) > 1.02 * min(every)
    assert apart or name != "trunnion", "all branches were alike"


def test_a_later_move_by_a_distance_is_provided_for() -> None:
    # The wall can be cut at C = 0 or 180; from 0 the move down by 350 would not fit.
    built = with_travel(mill(gouge="warn"), -300.0, 300.0)
    text = wall(0.0, 90.0) + "G91 G0 C{}\n"
    for distance in (-350.0, 250.0):
        path = trace(text.format(distance), built)
        assert_whole(path, built)
    assert of(text.format(-350.0), built)[1][1] > 0.1


def test_a_program_that_is_refused_somewhere_gives_the_choices_before() -> None:
    built = mill(gouge="warn")
    coincident = "G52 X0. Y0. Z0. F600.\n" + "X1. Y0. Z0.\n" * 7
    assert list(of(wall(0.0, 40.0) + "G0 Z250.\n" + coincident, built)) == [1]


def test_without_choices_or_with_wrong_ones_a_train_decides_for_itself() -> None:
    built = mill(gouge="warn")
    silent = Context.silent(built, "part.ngc")
    (block,) = blocks.read(CONE.format("90.").encode(), built, "part.ngc").blocks
    assert isinstance(block, CutCone)
    (cut,) = auto.build([block], silent)
    alone = train.choose([cut], silent, (0.0, 0.0))
    wrong = train.choose([cut], silent, (0.0, 0.0), (0.1, 0.2))
    assert wrong[0].start == alone[0].start
    other = (-alone[0].start[0], alone[0].start[1] + math.pi + 4.0 * math.pi)
    wanted = train.choose([cut], silent, (0.0, 0.0), other)
    assert wanted[0].start == pytest.approx(other, abs=1e-9)


def test_of_a_long_train_only_the_ends_of_its_cuts_are_kept() -> None:
    """A thousand surfaces of one chain took 32 MB while their branch was chosen."""
    built, kinematics = mill(gouge="warn"), kinematics_of(mill())
    silent = Context.silent(built, "part.ngc")
    (block,) = blocks.read(CONE.format("90.").encode(), built, "part.ngc").blocks
    assert isinstance(block, CutCone)
    fields = legs.Fields(list(auto.build([block], silent)), kinematics)
    kept, whole = (legs.options(fields, silent, (0.0, 0.0), whole) for whole in (False, True))
    assert [one.way for one in kept] == [one.way for one in whole] and len(kept) == 2
    for one, other in zip(kept, whole, strict=True):
        assert len(one.legs[0].u) == 2 < len(other.legs[0].u)
        assert one.legs[0].segment == other.legs[0].segment


# ---- unwinding ---------------------------------------------------------------------


def refused(text: str, built: Machine) -> ProgramError:
    with pytest.raises(ProgramError) as error:
        trace(text, built)
    return error.value


def test_a_distance_that_leaves_the_travel_is_refused_with_the_start_from_which_it_fits() -> None:
    built = with_travel(mill(), -720.0, 720.0)
    error = refused("G0 C319.8\nG91 G0 C405.5\n", built)
    assert error.line == 2
    assert "C would reach 725.300 deg" in error.sentence
    assert "5.300 deg beyond its travel of -720.000 to 720.000 deg" in error.sentence
    assert "unwind first: write G0 C-40.200 before this block, so that it starts with C at -40.200 deg" in (
        error.sentence
    )
    trace("G0 C-40.200\nG91 G0 C405.5\n", built)


def test_a_position_beyond_the_travel_is_not_helped_by_unwinding() -> None:
    assert "unwind" not in refused("G0 C800.\n", with_travel(mill(), -720.0, 720.0)).sentence


def test_a_block_that_turns_farther_than_the_travel_says_where_to_split_it() -> None:
    built = with_travel(mill(), -360.0, 360.0)
    error = refused(CONE.format("1080."), built)
    assert "it turns C through 1080.000 deg, more than its travel holds in any turn" in error.sentence
    assert "split the block at u = 0.6" in error.sentence
    assert "so that the second begins with C at 1.125 deg" in error.sentence


def test_a_train_that_winds_up_names_the_block_before_which_to_unwind() -> None:
    built = with_travel(mill(), -360.0, 360.0)
    first = CONE.format("540.")
    second = first.replace("Y15.", "Y-15.")
    error = refused(first + second, built)
    assert error.line == 2
    assert "unwind first: write G0 C180.000 before this block" in error.sentence
    assert_whole(trace(first + "G0 C180.000\n" + second, built), built)


def test_no_unwinding_is_offered_where_the_travel_is_less_than_a_turn() -> None:
    error = refused(CONE.format("360."), with_travel(mill(), -100.0, 100.0))
    assert "C would reach" in error.sentence
    assert "it turns C through 360.000 deg" in error.sentence
    assert "move the part" in error.sentence and "unwind" not in error.sentence


def test_a_nurbs_block_of_many_parts_is_one_train_with_one_choice() -> None:
    built = mill(gouge="warn")
    text = "G0 C300.\n" + nurbs(*blade())
    assert list(of(text, built)) == [2]
    assert_whole(trace(text, built), built)
