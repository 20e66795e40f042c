"""A spindle that the operator switches: the program stands until he has; nobody says how it turns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support.machines.planning_bench import Bench

from controller.ipc.handoff import COLUMN
from controller.machine import machine_file
from controller.program.modal import power_on
from controller.runtime.plan_messages import Announcement, News, Program
from controller.service import status
from controller.service.jobs import Job
from controller.state.modes import Mode, Request

HAND = machine_file.load("trunnion")
TEXT = "G21 G90 G53 G0 Z200\nS800 M3\nG53 G1 Z199.9 F600\nM4\nG53 G1 Z199.8\nM5\nM0\nG53 G1 Z199.9\nM30\n"


def test_a_program_stands_at_each_change_until_it_is_let_go_on(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HAND)
    job = Job(Program(TEXT.encode(), "part.ngc", bench.machine), "", state="running")
    bench.armed(TEXT, in_spindle=1)
    seen = []
    for _ in range(3):
        bench.until(Mode.HOLD)
        now = bench.snapshot()
        for news in bench.news:
            job.hear(news)
        bench.news.clear()
        job.announced.pass_rows(np.concatenate(bench.rows)[:, COLUMN["motion_id"]].astype(int).tolist())
        job.announced.say(now)
        seen.append((now.line, job.announced.awaited_speed(now), now.spindle_rev_min))
        told = status.machine_values(bench.machine, now, None, power_on(), 1)
        assert told["stands_at_stop"] is True
        assert told["spindle"]["at_speed"] is None and told["spindle"]["actual_rev_min"] is None
        bench.request(Request.RESUME)
    bench.until(Mode.READY)
    assert seen == [(2, 800.0, 800.0), (4, -800.0, -800.0), (7, 0.0, 0.0)], (
        "M0 is the stop at which it stands"
    )
    assert job.announced.awaited_speed(bench.snapshot()) is None and bench.snapshot().spindle_rev_min == 0.0


def test_a_hold_of_the_operator_asks_for_nothing(tmp_path: Path) -> None:
    bench = Bench(tmp_path, HAND)
    job = Job(Program(TEXT.encode(), "part.ngc", bench.machine), "", state="running")
    bench.armed("G21 G90 G53 G0 Z200\nG53 G1 Z150 F600\nS800 M3\nG53 G1 Z140\nM30\n", in_spindle=1)
    bench.until_line(2)
    bench.request(Request.HOLD)
    bench.until(Mode.HOLD)
    for news in bench.news:
        job.hear(news)
    job.announced.say(bench.snapshot())
    assert job.announced.awaited_speed(bench.snapshot()) is None


def test_what_is_asked_is_a_sentence_in_the_reader_s_language() -> None:
    from controller.messages import text

    assert text(status.spindle_change(-800.0)) == (
        "Switch the spindle on, counter-clockwise (M4), 800 1/min. Then let the program go on."
    )
    assert (
        text(status.spindle_change(0.0), "de")
        == "Die Spindel ausschalten (M5). Dann das Programm fortsetzen."
    )


def test_the_same_line_may_ask_for_another_speed_in_the_next_turn_of_a_loop(tmp_path: Path) -> None:
    job = Job(Program(b"", "part.ngc", HAND), "", state="running")
    job.hear(News(messages=(Announcement("", 2, 5, rev_min=800.0), Announcement("", 4, 5, rev_min=900.0))))
    bench = Bench(tmp_path, HAND)
    asked = []
    for motion_id, at_rest in ((1, False), (-1, True), (2, False), (3, False), (-1, True), (4, False)):
        mode = Mode.HOLD if at_rest else Mode.RUNNING
        now = bench.snapshot()._replace(motion_id=motion_id, line=5, at_rest=at_rest, mode=mode)
        job.announced.say(now)
        asked.append(job.announced.awaited_speed(now))
    assert asked == [None, 800.0, None, None, 900.0, None]
