"""The loaded program: its state and the time it still takes, by snapshots."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines.stepped_runs import shipped

from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import COLUMN, ROW, Snapshot, blank
from controller.machine import machine_file
from controller.plan.off_path import FIRST_ID
from controller.plan.report.passing import OWN
from controller.plan.restart.program_position import ENTRY_ID, LinePart
from controller.program import linked
from controller.runtime.plan_messages import Announcement, MotionFacts, News
from controller.service import jobs
from controller.service.job_status import to_dict
from controller.service.jobs import Job
from controller.state.modes import Mode


def snapshot(**values: object) -> Snapshot:
    return blank()._replace(**{"mode": Mode.RUNNING, "override": 1.0, "rapid_override": 1.0, **values})  # type: ignore[arg-type]


@pytest.fixture
def job() -> Job:
    made = jobs.mdi("G0 X1", shipped())
    made.time.check(10.0)
    made.arm(0)
    made.taken, made.state = True, "running"
    made.hear(News(finished=False))
    return made


def way(feed_mm_s: float | None) -> MotionFacts:
    return MotionFacts((0.0, 0.0, 0.0, 0.0, 0.0), feed_mm_s, "line")


def test_the_time_left_counts_with_the_override_that_was_and_the_one_that_is(job: Job) -> None:
    job.follow(snapshot(plan_time_s=100.0))
    job.follow(snapshot(plan_time_s=102.0))
    assert to_dict(job, snapshot(plan_time_s=102.0))["left_s"] == pytest.approx(8.0)
    job.follow(snapshot(plan_time_s=106.0, override=0.5))  # 4 s at half: 2 s of the check's time
    assert to_dict(job, snapshot(plan_time_s=106.0, override=0.5))["left_s"] == pytest.approx(12.0)
    assert to_dict(job, snapshot(plan_time_s=106.0))["left_s"] == pytest.approx(6.0)
    assert to_dict(job, snapshot(override=0.0))["left_s"] is None


def test_a_rapid_goes_by_its_own_override_and_a_way_aside_costs_nothing(job: Job) -> None:
    job.hear(News(finished=False, ways={3: way(None)}))
    job.follow(snapshot(plan_time_s=0.0))
    job.follow(snapshot(plan_time_s=2.0, motion_id=3, override=0.1))
    job.follow(snapshot(plan_time_s=9.0, motion_id=FIRST_ID))
    assert to_dict(job, snapshot())["left_s"] == pytest.approx(8.0)


def test_once_all_is_planned_the_time_left_is_that_of_the_plan(job: Job) -> None:
    job.hear(News(finished=True))
    assert to_dict(job, snapshot(plan_time_s=3.0, queue_end_s=5.5))["left_s"] == 2.5


@pytest.mark.parametrize(
    ("mode", "state"),
    [(Mode.RUNNING, "running"), (Mode.HOLD, "held"), (Mode.JOG, "held"), (Mode.READY, "stopping")],
)
def test_the_state_is_that_of_the_snapshot(job: Job, mode: Mode, state: str) -> None:
    assert to_dict(job, snapshot(mode=mode))["state"] == state


def test_what_another_plan_tells_is_not_of_a_program_whose_plan_is_gone(job: Job) -> None:
    job.lost = True
    job.hear(News(finished=True, whole=True))
    assert not job.news.whole


def test_ways_of_the_program_outlast_an_entry_and_a_way_aside(job: Job) -> None:
    job.hear(News(ways={1: way(1.0), 2: way(2.0), ENTRY_ID: way(3.0)}))
    assert job.motions.under_way(ENTRY_ID) == way(3.0) and job.motions.under_way(FIRST_ID) is None
    assert job.motions.under_way(2) == way(2.0) and job.motions.under_way(1) is None, "it lies behind"


def test_the_fraction_is_of_the_line_that_is_under_way_at_that_very_place(job: Job) -> None:
    lines = LinePart(0.0, 4, 0.5, 0.1), LinePart(5.0, 6, 0.0, 0.25)
    job.hear(News(ways={7: replace(way(1.0), lines=lines)}))
    assert [job.motions.fraction(7, s) for s in (0.0, 4.0, 5.0, 7.0, 9.5)] == pytest.approx(
        [0.5, 0.9, 0.0, 0.5, 1.0]
    )
    assert job.motions.fraction(8, 2.0) == 0.0, "nobody knows of it"


def test_by_the_marks_of_a_check_the_time_left_is_that_of_the_place_whatever_the_override_was(
    job: Job,
) -> None:
    job.time.check(10.0, (((4, 0.0, OWN, 0.0), 1.0), ((4, 1.0, OWN, 0.0), 9.0)))
    job.hear(News(finished=False, ways={7: replace(way(1.0), lines=(LinePart(0.0, 4, 0.0, 0.1, 4),))}))
    job.follow(snapshot(plan_time_s=0.0, motion_id=7, s=0.0, override=0.3))
    job.follow(snapshot(plan_time_s=20.0, motion_id=7, s=5.0, override=0.3))
    told = to_dict(job, snapshot(plan_time_s=20.0, motion_id=7, s=5.0))
    assert (told["left_s"], told["fraction"]) == (pytest.approx(5.0), pytest.approx(0.5))
    job.follow(snapshot(plan_time_s=22.0, motion_id=-1))  # a dwell
    assert to_dict(job, snapshot(plan_time_s=22.0))["left_s"] == pytest.approx(3.0)


@pytest.mark.parametrize("state", ["stopped", "fault"])
def test_the_place_stays_after_an_end_before_the_end(state: str, job: Job) -> None:
    job.time.check(10.0, (((4, 0.0, OWN, 0.0), 0.0), ((4, 1.0, OWN, 0.0), 10.0)))
    job.hear(News(finished=False, ways={7: replace(way(1.0), lines=(LinePart(0.0, 4, 0.0, 0.1, 4),))}))
    job.follow(snapshot(plan_time_s=6.0, motion_id=7, line=4, s=5.0))
    job.follow(snapshot(plan_time_s=7.0, motion_id=-1, line=0))  # it stands
    job.state, job.nominal_s = state, 5.0
    told = to_dict(job, snapshot(mode=Mode.READY, motion_id=-1, line=0, plan_time_s=9.0))
    found = [told[name] for name in ("state", "line", "block", "fraction", "elapsed_s", "left_s")]
    assert found == [state, 4, 7, 0.5, 6.0, 5.0]
    job.arm(0)
    assert to_dict(job, snapshot())["fraction"] == 0.0


def test_the_journal_has_all_that_is_told_of_a_place(job: Job) -> None:
    job.hear(News(ways={3: replace(way(10.0), end_s=20.0)}))
    job.origin_s = 2.0
    now = snapshot(plan_time_s=6.5, motion_id=3, s=5.0)
    job.follow(now)
    known, told = job.known(3, 5.0), to_dict(job, now)
    assert known.elapsed_s == told["elapsed_s"] == 4.5 and known.duration_s == told["duration_s"]
    assert known.in_block == {"what": "line", "fraction": 0.25, "u": None}


def test_the_place_stays_when_the_tick_has_dropped_all_and_nobody_has_seen_it_yet(job: Job) -> None:
    job.state = "running"
    job.follow(snapshot(mode=Mode.RUNNING, line=7, motion_id=3, plan_time_s=104.0))
    told = to_dict(job, snapshot(mode=Mode.FAULT, line=0, motion_id=-1, plan_time_s=104.5))
    assert (told["line"], told["block"]) == (7, 3)


def test_what_begins_inside_has_only_its_rest_left(job: Job) -> None:
    job.state, job.before_s = "loaded", 6.0
    told = to_dict(job, snapshot(mode=Mode.READY))
    assert (told["left_s"], told["fraction"]) == (4.0, 0.6)
    job.arm(0)
    assert to_dict(job, snapshot())["left_s"] == 4.0


def test_a_line_typed_by_hand_is_told_for_it_is_in_no_store(job: Job) -> None:
    assert to_dict(job, snapshot())["text"] == "G0 X1"
    job.program = replace(job.program, typed=False)
    assert to_dict(job, snapshot())["text"] is None


def test_what_the_program_says_is_told_at_its_place(job: Job) -> None:
    """Before a motion when it begins; before a stop when it holds there, though the plan read on."""
    job.hear(
        News(
            messages=(
                Announcement("start", 0),
                Announcement("turn it", 3, 7),
                Announcement("go on", 3),
                Announcement("end", 9),
            )
        )
    )
    seen = []
    for motion_id, line, at_rest in [
        (-1, 0, True),
        (0, 2, False),
        (2, 7, False),
        (-1, 7, True),
        (3, 8, False),
    ]:
        job.announced.say(snapshot(motion_id=motion_id, line=line, at_rest=at_rest))
        seen.append(to_dict(job, snapshot())["message"])
    assert seen == [None, "start", "start", "turn it", "go on"]
    job.announced.say(snapshot(motion_id=-1, line=9), ended=True)
    assert job.announced.messages == ["start", "turn it", "go on", "end"]


def test_the_tool_that_t_names_is_known_when_its_motion_begins(job: Job) -> None:
    job.hear(News(messages=(Announcement("", 3, tool=4), Announcement("", 9, tool=5))))
    job.announced.say(snapshot(motion_id=2))
    assert job.announced.take_named() is None
    job.announced.say(snapshot(motion_id=3))
    assert job.announced.take_named() == 4 and job.announced.messages == []


def test_what_a_probing_cycle_has_found_is_a_result_once_it_is_said(job: Job) -> None:
    job.hear(
        News(
            messages=(
                Announcement("edge edge_mm=12.500000", 0),
                Announcement("go on", 0),
                Announcement("top height_mm=1.0", 9),
            )
        )
    )
    job.announced.say(snapshot(motion_id=3, line=2))
    assert job.announced.take_found() == [{"cycle": "edge", "values": {"edge_mm": 12.5}}]


def test_a_job_is_the_program_with_the_files_that_it_calls(tmp_path: Path) -> None:
    (tmp_path / "a1").write_bytes(b"o<pocket> call\n/G0X1\nM30\n")
    (tmp_path / "b2").write_bytes(b"o<pocket> sub\nG0X5\no<pocket> endsub\n")
    files = {"pocket.ngc": str(tmp_path / "b2")}
    told = {"path": str(tmp_path / "a1"), "name": "main.ngc", "files": files, "block_delete": True}
    made = jobs.read(told, shipped())
    assert to_dict(made, snapshot())["block_delete"] is True
    program = made.program
    text, behind = linked.parts(program.text)
    assert text == b"o<pocket> call\n;/G0X1\nM30\n"
    assert behind == {"pocket": ("pocket.ngc", (tmp_path / "b2").read_bytes())}


def test_motions_at_feed_are_known_until_they_are_passed_and_none_of_a_dry_run(job: Job) -> None:
    job.hear(News(finished=False, ways={1: way(None), 2: way(5.0), 3: way(5.0), 4: way(None), 5: way(1.0)}))
    fed_in = job.motions.fed_in
    assert fed_in({1, 2}) == {2}
    assert fed_in({3, 4, -1, ENTRY_ID}) == {3} and fed_in({-1}) == set()
    assert fed_in({2, 3, 5}) == {3, 5}, "what is passed is forgotten"
    rows = np.zeros((1, len(ROW)))
    rows[0, COLUMN["mode"]], rows[0, COLUMN["motion_id"]] = Mode.RUNNING, 5
    assert job.take_rows(rows, 0.002) == {5}
    job.program = replace(job.program, dry_run_mm=10.0)
    assert job.take_rows(rows, 0.002) == set()
    job.arm(0)
    assert job.motions.fed_in({5}) == set()


def test_a_probing_cycle_is_run_as_a_typed_line_with_its_program() -> None:
    made = jobs.probing({"cycle": "bore", "values": {"most": 12.0}, "offset": "G54"}, shipped(), 0)
    text, files = linked.parts(made.program.text)
    assert jobs.probing({"cycle": "top", "offset": "G57"}, shipped(), 0).program.text.startswith(
        b"G21 G90 G94 G40 G54 "
    )
    assert made.is_mdi and bytes(text).endswith(b"o<probe_bore> call [12] [1]\n") and "probe_touch" in files


@pytest.mark.parametrize(("name", "head"), [("trunnion", b"M61 Q99\nG21 "), ("machining_centre", b"G21 ")])
def test_a_probing_cycle_knows_the_tool_that_was_put_in_by_hand(name: str, head: bytes) -> None:
    """Else a program begins with T1 in the spindle; a changer knows what is there."""
    made = jobs.probing({"cycle": "top", "offset": "none"}, machine_file.load(name), 99)
    assert made.program.text.startswith(head)


@pytest.mark.parametrize(
    ("args", "says"),
    [
        ({}, "no such probing cycle"),
        ({"cycle": "bore", "values": {"most": "far"}, "offset": "none"}, "0.1 to 500 mm"),
        ({"cycle": "bore", "values": [1], "offset": "none"}, "bore has no such value"),
        ({"cycle": "bore", "values": 3, "offset": "none"}, "bore has no such value"),
        ({"cycle": "bore"}, "no offset that a cycle sets"),
    ],
)
def test_a_probing_cycle_that_cannot_be_is_refused(args: dict[str, Any], says: str) -> None:
    with pytest.raises(CommandRefused, match=says) as error:
        jobs.probing(args, shipped(), 0)
    assert error.value.code == "bad"


def test_a_line_by_hand_may_call_the_cycles_that_ship() -> None:
    made = jobs.mdi("o<probe_bore> call [20] [0]", shipped())
    assert b"o<probe_pocket> sub" in made.program.text and to_dict(made, snapshot())["text"] == (
        "o<probe_bore> call [20] [0]"
    )
