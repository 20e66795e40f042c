"""The bus budget: its figures against frames written out bit by bit, its rows, and what it advises."""

import json
import random
from dataclasses import replace

import pytest
from support.oracles import frame_bits

from drives.load import budget, timeline
from drives.load.bus_frames import Kind
from drives.profile import Profile, Supervision
from drives.settings import BusSettings, IoSettings, MasterSettings, NodeSettings, SpindleSettings
from drives.texts import english

MASTER = MasterSettings()
SPINDLE = SpindleSettings("spindle", "can0", 20, "s.eds", 1000.0)
IO = IoSettings("io", "can0", 21, "io.eds", inputs=2, outputs=1)


def axes(*counts, **changes):
    """Nodes and buses: so many drives on each bus."""
    buses = [BusSettings(f"can{i}", "virtual", "hub", 1_000_000) for i in range(len(counts))]
    names = iter("XYZACUVW")
    nodes = [
        NodeSettings(next(names), f"can{i}", k + 1, "a.eds", **changes)
        for i, n in enumerate(counts)
        for k in range(n)
    ]
    return nodes, buses


def row_of(one, what):
    (found,) = (row for row in one.rows if english(row.text) == what)
    return found


# ---- figures -------------------------------------------------------------------------------


@pytest.mark.parametrize(("data_bytes", "bits"), [(0, 55), (1, 65), (4, 95), (6, 115), (8, 135)])
def test_the_worst_stuffed_frame_has_the_published_length(data_bytes, bits):
    assert budget.worst_bits(data_bytes) == bits


def test_five_drives_take_60_percent_of_2_ms():
    (one,) = budget.of(*axes(5), MASTER, 0.002)
    assert one.total_us == pytest.approx(1205.0)
    assert one.share == pytest.approx(0.6025)
    assert one.typical_us == pytest.approx(1050, rel=0.01)
    assert one.typical_us < one.longest_us < one.total_us
    assert one.fits()


def everything():
    """A bus with a bit of all that there is."""
    nodes, buses = axes(5)
    guarded = Profile(supervision=Supervision.GUARDING, rpdo=3, tpdo=3)
    nodes[1] = replace(nodes[1], profile=guarded, feedback_every=4)
    nodes[2] = replace(nodes[2], feed_forward=True)
    (one,) = budget.of(nodes, buses, MASTER, 0.004, SPINDLE, (IO,))
    return one


def test_each_row_is_as_long_as_its_frames_written_out():
    rng = random.Random(7)
    for row in everything().rows:
        free = row.data_bytes - len(row.fixed)
        if row.remote:
            lengths = [frame_bits.length(row.can_id, bytes(row.data_bytes), remote=True)]
        else:
            count = 1500 if free > 1 else 1
            lengths = [frame_bits.length(row.can_id, row.fixed + rng.randbytes(free)) for _ in range(count)]
        mean = sum(lengths) / len(lengths)
        assert max(lengths) <= row.longest_us <= row.worst_us, english(row.text)
        if free != 1:
            assert row.typical_us == pytest.approx(mean, abs=0.4 if free else 1e-9), english(row.text)


def test_the_longest_tick_has_payloads_that_make_it_and_none_that_exceed_it():
    (one,) = budget.of(*axes(1), MASTER)
    longest = 0
    for row in one.cyclic:
        bits = round(row.longest_us)
        longest += frame_bits.length(row.can_id, next(frame_bits.frames_of(row.can_id, row.data_bytes, bits)))
        assert next(frame_bits.frames_of(row.can_id, row.data_bytes, bits + 1), None) is None
    assert one.longest_us == longest


def test_the_rows_add_up_and_go_to_json():
    (one,) = budget.of(*axes(5), MASTER)
    plain = json.loads(json.dumps(one.to_dict()))
    assert len(plain["rows"]) == 1 + 5 * 3 + 6 + 5 + 2
    summed = sum(row["worst_us"] * row["per_tick"] for row in plain["rows"])
    assert summed == pytest.approx(plain["total_us"] + plain["background_us"])
    assert plain["share"] == pytest.approx(0.6025)
    assert plain["crowded_us"] == pytest.approx(sum(row["worst_us"] for row in plain["rows"]))


def test_without_bit_timing_everything_fits():
    nodes, _ = axes(5)
    (one,) = budget.of(nodes, [BusSettings("can0", "virtual", "hub", 0)], MASTER, 0.0005)
    assert one.share == one.typical_us == one.longest_us == 0.0
    assert one.fits() and one.sdo_every() == 1


# ---- rows ----------------------------------------------------------------------------------


def test_feedback_of_every_nth_sync_counts_whole_in_the_fullest_tick():
    (every,), (fourth,) = (budget.of(*axes(5, feedback_every=n), MASTER) for n in (1, 4))
    assert fourth.total_us == every.total_us
    assert fourth.typical_us < every.typical_us
    assert row_of(fourth, "feedback of X").per_tick == 0.25


def test_feed_forward_makes_setpoints_longer_and_the_controlword_a_frame_of_its_own():
    (one,) = budget.of(*axes(5, feed_forward=True), MASTER)
    assert one.total_us == pytest.approx(55 + 5 * (135 + 115))
    assert row_of(one, "setpoint of X").data_bytes == 8
    command = row_of(one, "command of X")
    assert (command.can_id, command.data_bytes, command.kind) == (0x301, 2, Kind.BACKGROUND)
    assert command.per_tick == pytest.approx(0.002 / 0.05)


def test_pdo_numbers_and_guarding_come_from_the_profile():
    profile = Profile(rpdo=3, tpdo=4, supervision=Supervision.GUARDING)
    (one,) = budget.of(*axes(1, profile=profile), MASTER)
    assert row_of(one, "setpoint of X").can_id == 0x401
    assert row_of(one, "feedback of X").can_id == 0x481
    asked, answer = row_of(one, "guarding of X"), row_of(one, "answer of X")
    assert asked.remote and asked.worst_us == 55.0 and answer.worst_us == 65.0
    assert asked.can_id == answer.can_id == 0x701
    assert not any(english(row.text) == "heartbeat of X" for row in one.rows)


def test_spindle_and_inputs_and_outputs_take_their_share():
    (bare,) = budget.of(*axes(5), MASTER)
    (one,) = budget.of(*axes(5), MASTER, None, SPINDLE, (IO,))
    assert one.total_us == bare.total_us + 2 * 115  # on its ramp the spindle is told a speed every tick
    assert row_of(one, "inputs of io").data_bytes == 2
    assert row_of(one, "outputs of io").can_id == 0x215
    (slower,) = budget.of(*axes(5), MASTER, None, replace(SPINDLE, mode=3), ())
    assert slower.total_us == bare.total_us + 115


def test_nodes_count_on_their_own_bus_only():
    one, other = budget.of(*axes(3, 2), MASTER, None, replace(SPINDLE, bus="can1"), (IO,))
    assert {row.sender for row in one.rows} == {"controller", "X", "Y", "Z", "io"}
    assert {row.sender for row in other.rows} == {"controller", "A", "C", "spindle"}


# ---- order on the wire ---------------------------------------------------------------------


def test_the_tick_is_sync_feedback_setpoints_without_a_gap():
    (one,) = budget.of(*axes(2), MASTER)
    slots = timeline.worst(one)
    assert [english(slot.row.text) for slot in slots] == [
        "SYNC", "feedback of X", "feedback of Y", "setpoint of X", "setpoint of Y",
    ]  # fmt: skip
    assert [slot.start_us for slot in slots] == [0.0, 55.0, 170.0, 285.0, 400.0]
    assert slots[-1].end_us == one.total_us
    assert timeline.typical(one)[-1].end_us == pytest.approx(one.typical_us)
    assert timeline.crowded(one)[-1].end_us == one.crowded_us


def test_the_last_setpoint_waits_for_what_goes_before_it_and_for_one_frame_on_the_wire():
    (one,) = budget.of(*axes(5), MASTER)
    assert one.last_us == 1205.0 + 65.0
    assert one.spare_us == 730.0
    (with_io,) = budget.of(*axes(5), MASTER, None, None, (replace(IO, node=1),))
    assert with_io.last_us == 1205.0 + 75.0 + 65.0 + 65.0  # inputs 181h, outputs 201h, a heartbeat


def test_a_tick_that_one_heartbeat_pushes_past_the_next_sync_is_refused_whatever_the_share():
    nodes, buses = axes(4)
    assert budget.of(nodes, buses, MASTER, 0.001)[0].share < 1.0
    (sentence,) = map(english, budget.advice(nodes, buses, MASTER, 1.0, 0.001))
    assert "one heartbeat in the way" in sentence and "1040 us" in sentence


def test_sdo_is_paced_by_the_room_that_is_left():
    assert budget.of(*axes(5), MASTER, 0.002)[0].sdo_every() == 1
    three, two = budget.of(*axes(3, 2), MASTER, 0.001)
    assert three.sdo_every() == 6 and two.sdo_every() == 1
    assert three.total_us + three.background_us + 270.0 / 6 <= 800.0
    assert budget.of(*axes(5), MASTER, 0.001)[0].sdo_every() is None


# ---- what would fit ------------------------------------------------------------------------


def test_five_drives_on_one_bus_do_not_fit_into_1_ms():
    nodes, buses = axes(5)
    assert not budget.of(nodes, buses, MASTER, 0.001)[0].fits()
    (sentence,) = map(english, budget.advice(nodes, buses, MASTER, period_s=0.001))
    assert "a period of 2 ms" in sentence
    assert "2 buses with at most 3 drives each (X Y Z | A C)" in sentence


def test_a_longer_period_is_one_that_the_drives_take():
    nodes, buses = axes(5, profile=Profile(period_min_s=0.001, period_step_s=0.005))
    (sentence,) = map(english, budget.advice(nodes, buses, MASTER, period_s=0.001))
    assert "a period of 5 ms" in sentence


def test_two_buses_with_three_and_two_drives_fit_into_1_ms():
    three, two = budget.of(*axes(3, 2), MASTER, 0.001)
    assert three.total_us == pytest.approx(745.0)
    assert two.total_us == pytest.approx(515.0)
    assert three.fits()
    assert two.fits()


def test_half_a_millisecond_takes_a_bus_per_axis():
    nodes, buses = axes(1, 1, 1, 1, 1)
    assert all(one.fits() for one in budget.of(nodes, buses, MASTER, 0.0005))
    (sentence,) = map(english, budget.advice(*axes(5), MASTER, period_s=0.0005))
    assert "5 buses with at most 1 drive each" in sentence


def test_a_slow_bus_is_told_the_bit_rate_that_fits():
    nodes, _ = axes(5)
    slow = [BusSettings("can0", "socketcan", "can0", 250_000)]
    (sentence,) = map(english, budget.advice(nodes, slow, MASTER))
    assert "a bit rate of 1000 kbit/s" in sentence


def test_a_bus_that_is_there_and_has_room_is_named():
    nodes, buses = axes(4, 1)
    (sentence,) = map(english, budget.advice(nodes, buses, MASTER, period_s=0.001))
    assert "bus can0: 4 drives" in sentence and "A on bus can1" in sentence
    assert "with another node number" not in sentence


def test_feed_forward_that_does_not_fit_is_named():
    nodes, buses = axes(3, feed_forward=True)
    (sentence,) = map(english, budget.advice(nodes, buses, MASTER, period_s=0.001))
    assert "feed_forward = false for X Y Z" in sentence


def test_what_the_advice_names_does_fit():
    for drives in range(1, 9):
        for period_s in (0.0005, 0.001, 0.002):
            nodes, buses = axes(drives)
            if budget.advice(nodes, buses, MASTER, period_s=period_s):
                longer = next(p for p in budget.PERIODS_S if budget.of(nodes, buses, MASTER, p)[0].fits())
                assert f"{longer * 1000:g} ms" in english(
                    budget.advice(nodes, buses, MASTER, period_s=period_s)[0]
                )
