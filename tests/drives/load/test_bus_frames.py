"""What the budget counts is what is sent: all frames of a working group, held against its rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.drives.group_bench import GroupBench, T, inputs_and_outputs, nodes, spindle
from support.oracles.bus_times import Wire

from drives.load import budget
from drives.load.bus_frames import Kind
from drives.profile import GENERIC, CyclicMode, Profile, Supervision
from drives.settings import BusSettings
from drives.texts import english

GUARDED = replace(GENERIC, supervision=Supervision.GUARDING)
TICKS = 1000

WAYS: list[tuple[str, dict[str, object], Profile]] = [
    ("as shipped", {}, GENERIC),
    ("feed-forward", {"feed_forward": True}, GENERIC),
    ("feedback every third SYNC", {"feedback_every": 3}, GENERIC),
    ("node guarding", {}, GUARDED),
    ("other PDO numbers", {}, replace(GENERIC, rpdo=3, tpdo=4)),
    ("interpolated position", {}, replace(GENERIC, mode=CyclicMode.IP)),
    ("feed-forward by other numbers", {"feed_forward": True}, replace(GENERIC, rpdo=4, command_rpdo=3)),
]


def listened(bench: GroupBench, ticks: int = TICKS) -> Wire:
    settings = [drive.settings for drive in bench.group.drives]
    turning = None if bench.spindle is None else bench.spindle.settings
    io = [node.settings for node in bench.io]
    (planned,) = budget.of(
        settings, [BusSettings("can", "virtual", "", 1_000_000)], bench.master, T, turning, io
    )
    wire = Wire(bench.rig.buses["can"], planned)
    for _ in range(ticks):
        bench.setpoints = [setpoint + 20 for setpoint in bench.setpoints]
        bench.tick()
    return wire


def assert_as_counted(wire: Wire) -> None:
    """Nothing is sent that is not counted; everything at intervals comes as often as counted, or less."""
    assert wire.uncounted() == set()
    assert wire.overruns() == 0
    assert wire.busy_us_per_tick() <= (wire.budget.total_us + wire.budget.background_us) * 1.01
    ticks = len(wire.syncs_s)
    for row in wire.budget.rows:
        if row.kind is Kind.OCCASIONAL or row.remote:
            continue
        sent = len(wire.times_s[row.can_id])
        assert sent <= ticks * row.per_tick * 1.01 + 2, english(row.text)
        if row.frame != "speed":  # which goes out while it changes
            assert sent >= ticks * row.per_tick * 0.9 - 2, english(row.text)


@pytest.mark.parametrize(("settings", "profile"), [way[1:] for way in WAYS], ids=[way[0] for way in WAYS])
def test_a_group_sends_what_is_counted_and_nothing_else(
    settings: dict[str, object], profile: Profile
) -> None:
    bench = GroupBench(nodes("XYZ", profile=profile, **settings))
    bench.enable()
    assert_as_counted(listened(bench))


def test_spindle_and_inputs_and_outputs_send_what_is_counted() -> None:
    bench = GroupBench(nodes("XY"), spindle=spindle(), io=[inputs_and_outputs()])
    bench.enable()
    assert bench.spindle is not None
    bench.spindle.want_speed(6000.0)
    assert_as_counted(listened(bench))


def test_in_the_fullest_tick_feedback_of_every_nth_sync_comes_all_at_once() -> None:
    bench = GroupBench(nodes("XYZ", feedback_every=4))
    bench.enable()
    wire = listened(bench, 200)
    together = sum(wire.per_tick(0x180 + node) for node in (1, 2, 3))
    assert set(np.unique(together)) == {0, 3}
