"""Inputs and outputs (CiA 401): frame by frame, and against the simulated node."""

import math
from struct import Struct

import pytest
from support.drives.group_bench import GroupBench, T, inputs_and_outputs, nodes

from drives import pdo
from drives.cia402 import Wanted
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.io_node import IoNode
from drives.settings import IoSettings

CONSUMER_S = 0.2
BEAT_S = 0.05


def new_node(**kind):
    return IoNode(IoSettings("panel", "can0", 20, "a.eds", **kind))


def hear(node, can_id, data, now_s):
    assert node.receive(can_id, memoryview(data), now_s)


def living(now_s=1.0):
    node = new_node()
    hear(node, 0x714, b"\x05", now_s)
    hear(node, 0x194, b"\x81", now_s)
    return node


def sent(node, now_s):
    frame = node.event_frame(now_s, BEAT_S)
    return None if frame is None else pdo.unpack(frame)


def test_inputs_are_one_word_with_the_first_byte_lowest():
    node = new_node(inputs=2)
    hear(node, 0x194, b"\x81\x01", 1.0)
    assert node.inputs == 0x181


def test_inputs_of_wrong_length_are_counted_and_not_used():
    node = living()
    for count in (1, 2):
        hear(node, 0x194, b"\x00\x00", 1.1)
        assert (node.inputs, node.malformed) == (0x81, count)


def test_inputs_are_fresh_from_the_first_frame_until_they_grow_old():
    node = new_node()
    assert not node.fresh(1.0, CONSUMER_S)
    hear(node, 0x714, b"\x05", 1.0)
    assert not node.fresh(1.0, CONSUMER_S)
    hear(node, 0x194, b"\x01", 1.0)
    assert node.fresh(1.1, CONSUMER_S)
    hear(node, 0x714, b"\x05", 1.3)
    assert not node.fresh(1.3, CONSUMER_S)  # it lives, but its inputs are not repeated


def test_a_node_without_event_timer_is_believed_as_long_as_it_lives():
    node = new_node(inputs_every_s=0.0)
    hear(node, 0x714, b"\x05", 1.0)
    hear(node, 0x194, b"\x01", 1.0)
    hear(node, 0x714, b"\x05", 9.0)
    assert node.fresh(9.1, CONSUMER_S)
    assert not node.fresh(9.3, CONSUMER_S)


@pytest.mark.parametrize(
    ("can_id", "data", "reason"),
    [
        (0x714, b"\x00", "restarted"),
        (0x714, b"\x7f", "pre-operational"),
        (0x094, bytes.fromhex("0050010000000000"), "in error"),
    ],
)
def test_a_node_that_restarts_or_fails_in_operation_is_lost_until_reset(can_id, data, reason):
    node = living()
    node.judge(True)
    assert node.fault(1.0, CONSUMER_S) is DriveFault.NONE
    hear(node, can_id, data, 1.1)
    hear(node, 0x714, b"\x05", 1.1)
    assert node.fault(1.1, CONSUMER_S) is DriveFault.IO_LOST, reason
    node.forget(True)
    assert node.fault(1.1, CONSUMER_S) is DriveFault.NONE, reason


def test_a_restart_while_the_machine_is_off_costs_nothing_but_freshness():
    node = living()
    hear(node, 0x714, b"\x00", 1.1)
    assert not node.fresh(1.1, CONSUMER_S)
    hear(node, 0x714, b"\x05", 1.2)
    assert node.fresh(1.2, CONSUMER_S)
    assert node.fault(1.2, CONSUMER_S) is DriveFault.NONE


def test_outputs_go_out_on_change_once_more_and_with_the_heartbeat():
    node = new_node()
    assert sent(node, 0.0) == (0x214, b"\x00")
    node.write(0x105)  # bit 8 is not there
    frames = [sent(node, 0.002 * i) for i in range(1, 60)]
    assert frames[:2] == [(0x214, b"\x05")] * 2
    told = [i for i, frame in enumerate(frames) if frame]
    assert told[:2] == [0, 1]
    assert told[2:] == pytest.approx([26, 51], abs=2)


def test_a_node_that_was_told_nothing_sends_its_first_word_once_and_then_with_the_heartbeat():
    node = new_node()
    assert (node.inputs, node.inputs_at_s, node.outputs, node.analogue) == (0, -math.inf, 0, None)
    told = [node.event_frame(i * 0.125, 0.5) is not None for i in range(9)]
    assert told == [i % 4 == 0 for i in range(9)]


def test_outputs_are_one_word_with_the_first_byte_lowest():
    node = new_node(outputs=2)
    node.write(0x181)
    assert sent(node, 0.0) == (0x214, b"\x81\x01")


def test_a_node_whose_inputs_were_never_heard_is_not_fresh_and_not_lost():
    node = new_node()
    hear(node, 0x714, b"\x05", 1.0)
    node.judge(True)
    assert not node.fresh(1.0, CONSUMER_S)
    assert node.fault(1.0, CONSUMER_S) is DriveFault.NONE


@pytest.mark.parametrize("begin", [(0, 0, 0), (100, -3, 7)])
def test_analogue_outputs_go_out_all_in_one_frame_on_change_once_more_and_with_the_heartbeat(begin):
    """CiA 401: 6411h, an i16 a channel, by RPDO 2."""
    node = new_node(analogue=begin)
    told = []

    def run(ticks):
        for _ in range(ticks):
            frame = node.analogue.event_frame(len(told) * 0.125, 0.5)
            told.append(None if frame is None else pdo.unpack(frame))

    def words(*counts):
        return (0x314, Struct("<3h").pack(*counts))

    run(6)
    node.write_analogue(2, 500)
    node.write_analogue(3, -32768)
    run(2)
    node.write_analogue(2, 500)  # nothing new
    run(5)
    first, then = words(*begin), words(begin[0], 500, -32768)
    assert told == [first, first, None, None, None, first, then, then, None, None, None, then, None]


def bench_with_io():
    bench = GroupBench(nodes("X"), io=[inputs_and_outputs()])
    bench.tick(60)
    return bench, bench.rig.io["panel"]


def test_inputs_of_the_simulated_node_arrive_within_two_ticks():
    bench, device = bench_with_io()
    assert bench.io[0].fresh(bench.now_s, CONSUMER_S)
    device.set_input(3, True, bench.now_s)
    bench.tick(2)
    assert bench.io[0].inputs == 0x08
    device.set_input(3, False, bench.now_s)
    bench.tick(2)
    assert bench.io[0].inputs == 0x00


def test_an_input_whose_frame_is_lost_is_there_after_the_event_timer():
    bench, device = bench_with_io()
    left = 1

    def tamper(_at_s, can_id, _frame):
        nonlocal left
        if can_id == 0x194 and left:
            left -= 1
            return ()
        return (0.0,)

    bench.rig.buses["can"].tamper = tamper
    device.set_input(0, True, bench.now_s)
    ticks = bench.until(lambda: bench.io[0].inputs == 1)
    assert left == 0
    assert ticks * T <= 0.05 + 2 * T


def test_outputs_reach_the_simulated_node_and_go_off_when_the_controller_falls_silent():
    bench, device = bench_with_io()
    bench.io[0].write(0x81)
    bench.tick(2)
    assert device.outputs == 0x81
    bench.rig.advance(bench.now_s + 0.5)
    assert device.outputs == 0


def test_a_silent_node_is_a_fault_of_the_group_within_its_time():
    bench, _ = bench_with_io()
    bench.enable()
    gone = (0x194, 0x714)
    bench.rig.buses["can"].tamper = lambda _at, can_id, _frame: () if can_id in gone else (0.0,)
    ticks = bench.until(lambda: bench.fault[0] is not DriveFault.NONE)
    assert bench.fault == (DriveFault.IO_LOST, -1)
    assert ticks * T <= CONSUMER_S + 0.05 + 2 * T
    bench.rig.buses["can"].tamper = None
    for wanted in (Wanted.QUICK_STOP, Wanted.RESET, Wanted.OFF):
        bench.group.want(wanted)
        bench.tick(60)
    bench.enable()
    assert bench.fault == (DriveFault.NONE, -1)
