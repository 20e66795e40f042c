"""The door between plan and tick: whole or not at all, never blocking, never torn."""

from __future__ import annotations

import itertools
import math
import os
import signal

import pytest
from support.machines.tick_bench import rapid_law

from controller.ipc.handoff import (
    COLUMN,
    ROW,
    Arrangement,
    Jog,
    Recorder,
    RequestInbox,
    SnapshotBoard,
    blank,
    flat,
    request_pair,
    send_arrangement,
    send_jog,
    send_request,
)
from controller.motion.pieces import commit_lead_s
from controller.state.live_state import Flat
from controller.state.modes import MAX_AXES, Fault, Mode, Request
from controller.state.requests import Outcome, answer

HERE = (0.0, 0.0, 0.0, 0.0, 0.0)
THERE = (100.0, 0.0, 0.0, 0.0, 0.0)


ANSWERED = tuple(answer(1 << 31 | n, Outcome.REFUSED, Fault.DOOR_OPEN) for n in range(16))


def written(tick: int) -> Flat:
    """As a tick leaves it; of what is not named, nothing."""
    faults = {"interlock": Fault.DOOR_OPEN, "warning": Fault.DRIVE_WARNING}
    numbers = {
        "motion_id": 7,
        "line": 42,
        "fault_axis": -1,
        "inputs": 1 << 63,
        "joints": (1.0, 2.0, 3.0, 4.0, 5.0),
    }
    return flat(blank()._replace(tick=tick, mode=Mode.HOLD, answers=ANSWERED, **faults, **numbers))


def test_an_answer_is_found_by_its_number_as_long_as_it_is_remembered() -> None:
    board = SnapshotBoard()
    board.write(written(1))
    now = board.read()
    assert now is not None
    assert now.came_of(1 << 31 | 3) == (Outcome.REFUSED, Fault.DOOR_OPEN)
    assert now.came_of(3) == (Outcome.NONE, Fault.NONE) and not now.has_taken(3), "of another sender"
    assert now.has_taken((1 << 31) + 1) and not now.has_taken(1 << 31 | 16)


def test_a_law_gives_place_speed_and_acceleration_and_clamps_its_time() -> None:
    law = rapid_law(100.0)
    s, v, a = law.at(law.duration_s / 2)
    assert s == pytest.approx(50.0) and v == pytest.approx(200.0) and abs(a) < 1e-9
    assert law.at(-1.0) == law.at(0.0)
    assert law.at(law.duration_s + 1.0)[0] == pytest.approx(100.0, abs=1e-9)


def test_requests_arrive_in_order_and_garbage_is_passed_over() -> None:
    operator, tick_end = request_pair()
    inbox = RequestInbox(tick_end)
    assert inbox.take() is None
    send_request(operator, Request.OVERRIDE, 0.5)
    operator.send(b"??")
    operator.send(bytes([200]) + bytes(8))
    send_request(operator, Request.HOLD)
    assert inbox.take() == (Request.OVERRIDE, 0.5)
    assert inbox.take() == (Request.HOLD, 0.0)
    assert inbox.take() is None


def test_what_commissioning_found_arrives_whole_and_is_told_from_a_jog() -> None:
    operator, tick = request_pair()
    inbox = RequestInbox(tick)
    found = Arrangement(0.25, 60 / 4000, (1.0, 60 / 4096, 0.5, 1e-6, 2.0))
    send_arrangement(operator, found)
    send_jog(operator, Jog((1.0, 0.0, 0.0, 0.0, 0.0), 25.0, 0.0))
    assert inbox.take() == (Request.ARRANGED, 0.25) and inbox.arranged == found
    assert inbox.jog is None
    assert inbox.take() == (Request.JOG, 25.0) and inbox.arranged == found
    send_request(operator, Request.ARRANGED, 1.0)
    assert inbox.take() is None, "of the wrong size"
    operator.close()
    tick.close()


def test_a_jog_arrives_with_its_line_and_only_in_a_datagram_of_its_own() -> None:
    operator, tick_end = request_pair()
    inbox = RequestInbox(tick_end)
    order = Jog((0.6, 0.0, -0.8, 0.0, 1e-3), 25.0)
    send_jog(operator, order)
    send_jog(operator, order._replace(length=2.5))
    send_request(operator, Request.JOG, 25.0)  # along what?
    operator.send(bytes([Request.HOLD]) + bytes(56))
    assert inbox.take() == (Request.JOG, 25.0) and inbox.jog == order
    assert inbox.take() == (Request.JOG, 25.0) and inbox.jog == order._replace(length=2.5)
    assert inbox.take() is None


def test_a_snapshot_reads_back_every_field(tmp_path: object) -> None:
    path = f"{tmp_path}/snapshot"
    board = SnapshotBoard(path)
    reader = SnapshotBoard(path, create=False)
    assert reader.read() is None
    board.write(written(5))
    board.write(written(6))
    found = reader.read()
    assert found is not None
    assert flat(found) == written(6)
    assert found.warning is Fault.DRIVE_WARNING and found.interlock is Fault.DOOR_OPEN
    assert found.mode is Mode.HOLD and found.line == 42 and found.joints[4] == 5.0


def test_a_reader_interrupted_by_two_writes_reads_again() -> None:
    board = SnapshotBoard()
    board.write(written(1))
    for tick in range(2, 50):
        board.write(written(tick))
        found = board.read()
        assert found is not None and found.tick == tick


def test_a_reader_never_meets_a_counter_that_is_only_half_written() -> None:
    """Another process writes as fast as it can: there is always a snapshot, and every row comes once."""
    board, recorder = SnapshotBoard(), Recorder()
    values, row = flat(blank()), [0.0] * len(ROW)
    board.write(values)
    writer = os.fork()
    if not writer:
        for tick in itertools.count():
            board.write(values)
            row[0] = float(tick)
            recorder.write(row)
    try:
        last = -1
        for _ in range(4_000):
            assert all(board.read() for _ in range(20))
            ticks = recorder.drain()[:, 0]
            if len(ticks):
                assert ticks[0] > last
                last = int(ticks[-1])
    finally:
        os.kill(writer, signal.SIGKILL)
        os.waitpid(writer, 0)


def test_the_recorder_gives_each_row_once_and_counts_what_was_too_late() -> None:
    recorder = Recorder(rows=64)
    for n in range(10):
        recorder.write([float(n)] * len(ROW))
    rows = recorder.drain()
    assert rows.shape == (10, len(ROW)) and list(rows[:, COLUMN["tick"]]) == list(range(10))
    assert recorder.drain().shape == (0, len(ROW))
    for n in range(200):
        recorder.write([float(n)] * len(ROW))
    rows = recorder.drain()
    assert rows[-1, 0] == 199 and len(rows) == 48 and recorder.lost == 152


def test_the_newest_rows_can_be_had_again_after_they_were_drained() -> None:
    recorder = Recorder(rows=64)
    for n in range(100):
        recorder.write([float(n)] * len(ROW))
    recorder.drain()
    assert list(recorder.last(5)[:, 0]) == [95, 96, 97, 98, 99]
    assert len(recorder.last(1000)) == 48 and recorder.lost == 52


def test_a_row_has_a_place_for_every_axis() -> None:
    assert sum(name.startswith("setpoint_") for name in ROW) == MAX_AXES


@pytest.mark.parametrize("period_s", (0.0005, 0.001, 0.002, 0.005, 0.01))
def test_the_commit_point_is_far_enough_ahead_for_any_period(period_s: float) -> None:
    lead = commit_lead_s(period_s)
    assert lead >= 0.02 and lead >= 3 * period_s and math.isfinite(lead)
