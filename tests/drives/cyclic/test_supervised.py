"""Signs of life of a node: heartbeat, node guarding with its toggle bit, and how both are missed."""

import pytest

from drives import pdo
from drives.cyclic.supervised import Supervised

CONSUMER_S = 0.2


def guarded():
    return Supervised(3, guarded=True)


def answer(node, byte, now_s):
    assert node.receive(0x703, memoryview(bytes([byte])), now_s)


def test_the_request_is_a_remote_frame_of_the_heartbeat_s_identifier():
    assert pdo.unpack(guarded().guard_frame) == (pdo.REMOTE_FLAG | 0x703, b"\0")


def test_nothing_is_missed_before_the_first_request():
    assert not guarded().silent(100.0, CONSUMER_S)


def test_answers_are_missed_from_the_first_request_on():
    node = guarded()
    node.request_sent(1.0)
    node.request_sent(1.1)
    assert not node.silent(1.2, CONSUMER_S)
    assert node.silent(1.21, CONSUMER_S)


@pytest.mark.parametrize(("first", "second"), [(0x05, 0x85), (0x85, 0x05)])
def test_an_answer_whose_toggle_bit_changes_is_a_sign_of_life(first, second):
    node = guarded()
    answer(node, first, 1.0)
    answer(node, second, 1.05)
    assert node.heartbeat_at_s == 1.05
    assert node.nmt_state == pdo.NMT_OPERATIONAL


def test_an_answer_whose_toggle_bit_stays_counts_as_none():
    node = guarded()
    answer(node, 0x05, 1.0)
    for i in range(1, 6):
        answer(node, 0x05, 1.0 + 0.05 * i)
    assert node.silent(1.25, CONSUMER_S)


def test_one_lost_answer_costs_one_more_and_no_fault():
    node = guarded()
    heard = []
    for i, byte in enumerate((0x05, None, 0x05, 0x85, 0x05)):  # the second, 0x85, is lost
        now_s = 1.0 + 0.05 * i
        if byte is not None:
            answer(node, byte, now_s)
        heard.append(node.heartbeat_at_s)
        assert not node.silent(now_s, CONSUMER_S)
    assert heard[2] == 1.0  # not as expected
    assert heard[3] == pytest.approx(1.15)


def test_after_a_restart_the_toggle_bit_may_begin_anew():
    node = guarded()
    answer(node, 0x05, 1.0)
    answer(node, 0x00, 1.1)  # boot-up
    answer(node, 0x7F, 1.15)
    assert node.heartbeat_at_s == 1.15
    assert node.nmt_state == pdo.NMT_PRE_OPERATIONAL


def test_a_sign_of_life_of_wrong_length_is_counted_and_not_believed():
    node = Supervised(3)
    node.receive(0x703, memoryview(b""), 1.0)
    node.receive(0x703, memoryview(b"\x05\x05"), 1.0)
    assert node.malformed == 2
    assert node.nmt_state == -1


def test_frames_of_others_are_not_taken():
    assert not Supervised(3).receive(0x704, memoryview(b"\x05"), 1.0)


def emergency(node, data):
    assert node.receive(0x083, memoryview(data), 0.0)
    return node.emcy_code


def test_an_error_is_over_only_with_an_empty_register():
    """CiA 301, 7.2.7.1: 0000h with an empty register (1001h) resets; without, other errors are left."""
    node = Supervised(3)
    assert emergency(node, b"\x10\x23\x02") == 0x2310
    assert emergency(node, b"\0\0\x02") == 0x2310
    assert emergency(node, b"\0\0\0") == 0
    assert emergency(node, b"\x10\x23") == 0x2310
    assert emergency(node, b"\0\0") == 0  # of one too short for a register there is none


def test_after_a_toggle_bit_of_1_one_of_0_must_come():
    node = guarded()
    answer(node, 0x85, 1.0)
    answer(node, 0x85, 1.1)
    assert node.heartbeat_at_s == 1.0
    answer(node, 0x05, 1.2)
    answer(node, 0x05, 1.3)
    assert node.heartbeat_at_s == 1.2


def test_silence_is_longer_than_its_time_and_not_just_as_long():
    node = Supervised(3)
    answer(node, 0x05, 1.0)
    assert not node.silent(1.25, 0.25)
    assert node.silent(1.2500001, 0.25)
