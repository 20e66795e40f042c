"""What a service tells of single ticks, of its buses, and of late ticks."""

from __future__ import annotations

import time

import numpy as np
import pytest

from controller.api import ticks
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import COLUMN, ROW, Recorder
from controller.machine import machine_file
from controller.service import diagnostics
from controller.service.node_status import LastFrames
from drives import pdo

MACHINE = machine_file.load("trunnion")


def recorder(*numbers: int) -> Recorder:
    found = Recorder(rows=4096)
    write(found, *numbers)
    return found


def write(found: Recorder, *numbers: int) -> None:
    for number in numbers:
        row = [0.0] * len(ROW)
        row[COLUMN["tick"]] = number
        found.write(row)


def told(found: Recorder | None, **args: object) -> list[int]:
    said = diagnostics.rows(found, args)
    return [int(row[COLUMN["tick"]]) for row in ticks.unpacked(said)]


def test_rows_come_after_the_last_that_is_known_and_in_order() -> None:
    found = recorder(*range(1000))
    assert told(found, after=995) == [996, 997, 998, 999]
    assert told(found, after=10, most=3) == [11, 12, 13]
    assert told(found, after=999) == []


def test_nothing_is_left_out_where_a_tick_has_written_many_rows_meanwhile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A busy computer keeps the service waiting between two looks, and the tick does not."""
    found, look = recorder(*range(1000)), Recorder.last
    unwritten = iter((range(1000, 1300), range(1300, 2400)))

    def held_back(self: Recorder, rows: int) -> np.ndarray:
        newest = look(self, rows)
        write(self, *next(unwritten, ()))
        return newest

    monkeypatch.setattr(Recorder, "last", held_back)
    assert told(found, after=990, most=500) == list(range(991, 1491))


def test_at_first_as_many_are_told_as_are_kept() -> None:
    assert told(recorder(*range(1000)), kept=5) == [995, 996, 997, 998, 999]


def test_no_answer_is_larger_than_the_door_takes() -> None:
    found = Recorder(rows=4096)
    rng = np.random.default_rng(1)
    for i in range(1000):
        found.write((float(i), *rng.random(len(ROW) - 1)))
    assert len(diagnostics.rows(found, {"most": 10_000})["rows"]) < 200_000


def test_ticks_that_count_from_zero_again_are_told_as_such() -> None:
    said = diagnostics.rows(recorder(0, 1, 2), {"after": 5000})
    assert said["anew"] is True
    assert len(ticks.unpacked(said)) == 3


def test_without_a_tick_process_there_are_no_rows() -> None:
    assert told(None) == [] and told(Recorder(rows=64)) == []


@pytest.mark.parametrize("value", [-1, 1.5, "x", True])
def test_what_is_no_number_of_a_tick_is_refused(value: object) -> None:
    with pytest.raises(CommandRefused, match="whole number"):
        diagnostics.rows(recorder(1), {"after": value})


def test_late_ticks_are_counted_in_classes_of_the_period() -> None:
    found = np.zeros((5, len(ROW)))
    found[:, COLUMN["lateness_s"]] = np.array([0.0, 0.01, 0.3, 0.3, 5.0]) * 0.002
    late = diagnostics.lateness(found, 0.002)
    assert sum(late["ticks"]) == 5
    assert late["ticks"][0] == 2 and late["ticks"][6] == 2 and late["ticks"][-1] == 1
    assert late["from_us"][6] == late["skipped_from_us"] == 500.0


def test_a_bus_is_measured_by_the_frames_that_were_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    log = LastFrames()
    now_s = 1000.0
    monkeypatch.setattr(diagnostics.time, "time", lambda: now_s)
    for i in range(50):
        log(pdo.FRAME.pack(pdo.SYNC, 0, bytes(8)), now_s - 0.5 + i * 0.002)
        for node in range(5):
            log(pdo.FRAME.pack(0x201 + node, 6, bytes(8)), now_s - 0.5 + i * 0.002)
    measured = diagnostics.measured(log, 1_000_000, 0.002)
    bits = 55 + 5 * 115
    assert measured["frames_per_s"] == 300
    assert measured["fullest_share"] == pytest.approx(bits / 2000.0)
    assert measured["measured_share"] == pytest.approx(50 * bits / 1e6)


def test_error_frames_are_counted_and_tell_the_counters() -> None:
    log = LastFrames()
    log(pdo.FRAME.pack(pdo.ERROR_FLAG | 4, 8, bytes((0, 0, 0, 0, 0, 0, 96, 12))), time.time())
    measured = diagnostics.measured(log, 1_000_000, 0.002)
    assert (measured["error_frames"], measured["transmit_errors"], measured["receive_errors"]) == (1, 96, 12)


def test_every_bus_of_a_machine_is_told_with_its_budget() -> None:
    said = diagnostics.buses(machine_file.load("trunnion_two_buses"), {}, recorder(1, 2))
    assert [bus["name"] for bus in said["buses"]] == ["can0", "can1"]
    assert all(0.0 < bus["budget_share"] < said["max_share"] for bus in said["buses"])
    assert 0.0 < said["near_share"] < said["max_share"]
    assert sum(said["lateness"]["ticks"]) == 2
