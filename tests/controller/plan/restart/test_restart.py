"""Start at a line and fraction of a block: what is found, and what is refused."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from support.machines.interrupted_runs import EXAMPLE_2, LINES, TIPS, rest_of, segments, source
from support.machines.stepped_runs import shipped

from controller.machine.kinematics import kinematics_of
from controller.plan.restart import entry, restart
from controller.plan.restart.program_position import ENTRY_ID, FORMER, Spot
from controller.plan.restart.reentry import WayOnto
from controller.plan.segment import ContinuousPath, Pause
from controller.program.program import Act, ProgramError

FIRST, SECOND = 10, 19  # lines of the two surfaces of Example 2
HOME = (0.0, 0.0, 260.0, 0.0, 0.0)


def test_a_fraction_of_a_surface_is_that_share_of_its_contact_with_the_state_it_is_cut_in() -> None:
    machine = shipped()
    rest = rest_of(EXAMPLE_2, Spot(SECOND, 0.25), machine)
    cut = segments(EXAMPLE_2, machine)[rest.spot.motion_id]
    assert rest.what == "cut" and cut.place.line == SECOND
    assert rest.spot.s == pytest.approx(0.25 * cut.motion.end, rel=1e-12)
    modal = rest.target.modal
    assert (modal.tool, modal.offset, modal.spindle_rev_min, modal.coolant) == (2, 0, 12000.0, 0)


@pytest.mark.parametrize("share", [0.02, 0.98])
def test_a_lead_is_begun_again_at_its_start_and_one_that_leads_off_is_passed_over(share: float) -> None:
    machine = shipped()
    found = {s.name: (i, s) for i, s in reversed(segments(EXAMPLE_2, machine).items())}
    which, lead = found["lead in"]
    rest = rest_of(EXAMPLE_2, Spot(lead.place.line, 0.0, which, share * lead.motion.end), machine)
    assert rest.what == "lead in" and (rest.spot.motion_id, rest.spot.s) == (which, 0.0)
    assert rest.target.joints == pytest.approx(lead.start, abs=1e-9)
    which, lead = found["lead out"]
    rest = rest_of(EXAMPLE_2, Spot(lead.place.line, 1.0, which, share * lead.motion.end), machine)
    assert rest.what == "pause"


@pytest.mark.parametrize("fraction", [0.0, 0.3, 1.0])
def test_the_entry_ends_at_the_very_joints_of_the_uninterrupted_path(fraction: float) -> None:
    machine = shipped()
    rest = rest_of(EXAMPLE_2, Spot(SECOND, fraction), machine)
    chains = [item for item in rest.entered(HOME, 2) if isinstance(item, ContinuousPath)]
    k = next(i for i, chain in enumerate(chains) if (chain.first_id or 0) < ENTRY_ID)
    end = chains[k - 1].segments[-1].end
    first = segments(EXAMPLE_2, machine)[rest.spot.motion_id]
    there = first.motion.joints(rest.spot.s, end[3:], kinematics_of(machine))
    assert there is not None and np.abs(np.subtract(there, end)).max() < 1e-9
    assert chains[k].from_s == rest.spot.s


def test_the_rotaries_of_an_entry_turn_at_the_retract_height_and_the_last_way_is_along_the_tool_axis() -> (
    None
):
    machine = shipped()
    kinematics = kinematics_of(machine)
    rest = rest_of(EXAMPLE_2, Spot(FIRST, 0.6), machine)
    low = (10.0, 100.0, 150.0, 0.2, 0.1)
    for item in rest.entered(low, 2):
        if isinstance(item, Pause) or (item.first_id or 0) < ENTRY_ID:
            continue
        for segment in item.segments:
            if segment.name == "lead in":
                continue
            turns = max(abs(a - b) for a, b in zip(segment.start[3:], segment.end[3:], strict=True))
            assert turns == 0.0 or min(segment.start[2], segment.end[2]) >= machine.retract_mm - 1e-9
            if segment.name == "plunge":
                axis = kinematics.forward(segment.end, 0.0).axis
                a, b = (kinematics.forward(q, 0.0).tip for q in (segment.start, segment.end))
                way = np.subtract(b, a)
                assert np.linalg.norm(np.cross(way, axis)) < 1e-9 and np.dot(way, axis) < 0.0


def test_another_tool_in_the_spindle_is_changed_at_a_stop_and_the_spindle_turns_before_the_way_down() -> None:
    rest = rest_of(EXAMPLE_2, Spot(FIRST, 0.5), shipped())
    acts = [item.act for item in islice(rest.entered(HOME, 1), 6) if isinstance(item, Pause)]
    assert acts == [Act.TOOL, Act.STOP, Act.SPINDLE]
    acts = [
        item.act
        for item in islice(rest_of(EXAMPLE_2, Spot(FIRST, 0.5), shipped()).entered(HOME, 2), 4)
        if isinstance(item, Pause)
    ]
    assert acts == [Act.SPINDLE]


def test_a_line_without_a_motion_starts_at_the_next_one_and_has_no_fraction() -> None:
    machine = shipped()
    assert rest_of(EXAMPLE_2, Spot(12, 0.0), machine).spot.line == SECOND
    with pytest.raises(ProgramError, match="this line moves nothing"):
        rest_of(EXAMPLE_2, Spot(12, 0.5), machine)


def test_a_line_that_only_sets_something_is_begun_with_the_state_before_it() -> None:
    rest = rest_of(LINES, Spot(2, 0.0), shipped())
    assert rest.what == "pause" and rest.spot.line == 2
    assert (rest.target.modal.spindle_rev_min, rest.target.modal.coolant) == (0.0, 0)
    dwell = rest_of(LINES, Spot(7, 0.0), shipped())
    assert dwell.what == "pause" and dwell.target.modal.spindle_rev_min == 8000.0
    assert dwell.target.modal.coolant == 2


def test_a_rapid_is_not_gone_through_in_part_but_entered_at_its_end() -> None:
    machine = shipped()
    rest = rest_of(LINES, Spot(3, 0.5), machine)
    assert rest.spot.line == 4 and rest.spot.s == 0.0
    rapid = next(s for s in segments(LINES, machine).values() if s.place.line == 3)
    assert np.abs(np.subtract(rest.target.joints, rapid.end)).max() < 1e-12


def test_a_fraction_of_a_blended_line_is_a_place_inside_of_its_spline() -> None:
    machine = shipped()
    rest = rest_of(TIPS, Spot(30, 0.5), machine)
    assert rest.spot.line == 30 and rest.spot.fraction == pytest.approx(0.5, abs=1e-9)
    later = rest_of(TIPS, Spot(31, 0.5), machine)
    assert later.spot.motion_id == rest.spot.motion_id and later.spot.s > rest.spot.s


@pytest.mark.parametrize(
    ("spot", "words"),
    [
        (Spot(FIRST, 1.5), "0 to 1"),
        (Spot(FIRST, float("nan")), "0 to 1"),
        (Spot(400, 0.0), "choose an earlier one"),
        (Spot(SECOND, 0.0, 4000, 0.0), "choose an earlier one"),
    ],
)
def test_a_place_that_the_program_does_not_have_is_refused_in_a_sentence(spot: Spot, words: str) -> None:
    with pytest.raises(ProgramError, match=words):
        rest_of(EXAMPLE_2, spot, shipped())


def test_a_program_that_is_refused_before_the_place_is_refused() -> None:
    with pytest.raises(ProgramError):
        rest_of(EXAMPLE_2.replace("G52 X10.5", "G52 X10.5 R3."), Spot(SECOND, 0.0), shipped())


def test_an_entry_beyond_the_travel_is_refused_with_its_line() -> None:
    machine = shipped()
    target = rest_of(EXAMPLE_2, Spot(FIRST, 0.5), machine).target
    beyond = (*HOME[:4], 1e4)
    how = (2, WayOnto(machine, kinematics_of(machine)), "p")
    assert entry.enter(target, beyond, *how), "from there it may come"
    with pytest.raises(ProgramError, match="way back into the program"):
        entry.enter(target, (301.0, *HOME[1:2], 100.0, *HOME[3:]), *how)


@pytest.mark.parametrize("name", ["trunnion", "table_head", "head_head", "oblique45"])
def test_a_dry_run_is_the_same_program_off_the_part_along_the_tool_axis(name: str) -> None:
    machine = shipped(name)
    plain = source(EXAMPLE_2, machine)
    dry = source(EXAMPLE_2, machine, 12.0)
    rest = restart.find(dry, Spot(FIRST, 0.4))
    base = restart.find(plain, Spot(FIRST, 0.4))
    assert (rest.target.modal.spindle_rev_min, rest.target.modal.coolant) == (0.0, 0)
    here = plain.kinematics.forward(rest.target.joints, 0.0)
    there = plain.kinematics.forward(base.target.joints, 0.0)
    way = np.subtract(here.tip, there.tip)
    assert np.abs(way - 12.0 * np.array(there.axis)).max() < 1e-9
    for item in rest.items:
        assert not isinstance(item, Pause) or item.modal.spindle_rev_min == 0.0


LOOPS = """G21 G90 G61 T2 M6
S8000 M3
G0 X0. Y0. Z60.
G1 Z20. F1500.
o100 sub
G1 X#1
Y#2
o100 endsub
#10=0
o101 repeat [3]
#10=[#10 + 1]
o100 call [#10] [10 * #10]
o101 endrepeat
G0 Z60.
M30
"""


def test_a_line_that_runs_more_than_once_is_begun_at_its_first_time() -> None:
    rest = rest_of(LOOPS, Spot(7, 0.0), shipped())
    assert (rest.spot.line, rest.spot.motion_id) == (7, 3)
    again = rest_of(LOOPS, Spot(7, 0.0, rest.spot.motion_id + 2, 0.0), shipped())
    assert again.target.joints[:2] == (8.0 + 2.0, 96.0 + 10.0)  # the work offset, and the second time
    assert rest_of(LOOPS, Spot(6, 0.5), shipped()).target.joints[:2] == (8.0 + 0.5, 96.0)
    assert rest_of(LOOPS, Spot(1, 0.0), shipped()).what == "pause"


@pytest.mark.parametrize(
    ("spot", "phrase"),
    [
        (Spot(11, 0.0), "this line moves nothing"),
        (Spot(12, 0.5), "this line moves nothing"),
        (Spot(7, 0.5, FORMER), "not known which time"),
    ],
)
def test_which_time_a_line_was_running_is_never_guessed(spot: Spot, phrase: str) -> None:
    with pytest.raises(ProgramError, match=phrase):
        rest_of(LOOPS, spot, shipped())


def test_in_a_smooth_row_a_line_is_begun_at_its_first_time() -> None:
    smooth = LOOPS.replace("G61", "G64 P0.01")
    rest = rest_of(smooth, Spot(7, 0.5), shipped())
    x, y = rest.target.joints[:2]
    assert abs(x - 9.0) < 0.01 and 96.0 < y < 106.0
    assert rest_of(smooth, rest.spot, shipped()).target.joints == rest.target.joints


HEAD = "G21 G90 G54 G61 F300.\nT2 M6\nS6000 M3\nG43 H2\nG0 X0. Y0. Z20.\n"
ALL_OF_THE_LANGUAGE = {
    "subs": "o1 sub\nG91\nG1 X#1 Y1.\nG90\no1 endsub\n"
    + HEAD
    + "o1 call [2]\nG52 X3. Y1.\no1 call [4]\nG1 X0.\n",
    "loops": HEAD + "#1=0\no2 while [#1 LT 3]\n#1=[#1+1]\nG1 X#1\nG3 X[#1+2] Y0. R1.\no2 endwhile\n"
    "G68 X1. Y1. R30.\nG1 X9.\n",
    "cycles": HEAD + "G99 G83 X1. Y2. Z-5. R2. Q2. F80.\nX5.\nG98 X9.\nG80\nG1 Z5. F200.\n",
    "beside a contour": HEAD
    + "G41.1 D4. G1 X10. Y0.\nX20.\nG3 X30. Y10. R10.\nG1 Y30.\nG40 G1 X40. Y40.\nG0 Z30.\nG1 X1.\n",
    "tilted": HEAD + "G68.2 P1 Q123 X5. Y0. Z0. I20. J10. K0.\nG53.1\nG0 X0. Y0. Z10.\nG1 Z1.\nX9. Y3.\n"
    "G81 X1. Z-2. R2.\nG80\nG69\nG1 Z60.\n",
}


@pytest.mark.parametrize("name", ALL_OF_THE_LANGUAGE)
def test_what_is_left_from_any_line_on_is_what_the_whole_run_has_from_there(name: str) -> None:
    text, machine = ALL_OF_THE_LANGUAGE[name] + "M30\n", shipped(unset=())
    whole = list(segments(text, machine).values())
    for line in {segment.place.line for segment in whole}:
        rest = rest_of(text, Spot(line, 0.0), machine)
        left = [
            segment for item in rest.items if isinstance(item, ContinuousPath) for segment in item.segments
        ]
        behind = whole[len(whole) - len(left) :]
        assert [(s.place, s.end, s.feed_mm_s) for s in left] == [
            (s.place, s.end, s.feed_mm_s) for s in behind
        ]
        first = next(k for k, segment in enumerate(whole) if segment.place.line == line)
        skipped = whole[first : len(whole) - len(left)]
        assert all(segment.feed_mm_s is None for segment in skipped)  # rapids: the entry leads to their end
