"""One drive against a device model of a dozen lines: frames in, one frame out."""

import math
from dataclasses import replace

import pytest

from drives import cia402, pdo
from drives.cia402 import State, Wanted
from drives.cyclic.drive import STALE_STATUSWORDS, STOOD_FEEDBACKS, Drive, DriveFault
from drives.cyclic.power_stage import STALE_FEEDBACKS
from drives.profile import GENERIC, CyclicMode
from drives.settings import INT32_MAX, INT32_MIN, FollowingWindow, NodeSettings

SOD, RTSO, SO, OE, QSA, FAULT = 0x0250, 0x0231, 0x0233, 0x0237, 0x0217, 0x0218
FOLLOWS = cia402.FOLLOWS_COMMAND
CONSUMER_S = 0.2


def new_drive() -> Drive:
    return Drive(NodeSettings("X", "can0", 1, "a.eds"))


def tell(drive: Drive, statusword: int, position: int = 1000, now_s: float = 0.0) -> None:
    assert drive.receive(0x181, memoryview(pdo.FEEDBACK.pack(statusword, position)), now_s)


def sent(drive: Drive, setpoint: int = 0, now_s: float = 0.0) -> tuple[int, int]:
    can_id, data = pdo.unpack(drive.frame(setpoint, now_s))
    assert can_id == 0x201
    controlword, target = pdo.COMMAND.unpack(data)
    return controlword, target


def enabled(position: int = 1000) -> Drive:
    drive = new_drive()
    drive.want(Wanted.ENABLED)
    tell(drive, OE | FOLLOWS, position)
    return drive


def test_a_drive_that_never_spoke_is_told_disable_voltage():
    drive = new_drive()
    drive.want(Wanted.ENABLED)
    assert sent(drive) == (0x00, 0)
    assert drive.state is State.UNKNOWN


def test_before_anything_is_heard_a_drive_claims_nothing():
    drive = new_drive()
    assert (drive.state, drive.wanted, drive.statusword) == (State.UNKNOWN, Wanted.OFF, 0)
    assert (drive.fresh, drive.following, drive.homing_done, drive.homing_error) == (False,) * 4
    assert (drive.lost, drive.refused, drive.malformed, drive.emcy_code, drive.nmt_state) == (0, 0, 0, 0, -1)
    assert drive.position_at_s == drive.heartbeat_at_s == -math.inf
    assert drive.in_position and drive.probe is None


@pytest.mark.parametrize("every", [1, 2, 3])
def test_a_quick_stop_of_a_drive_never_enabled_is_judged_from_nothing(every):
    drive = Drive(NodeSettings("X", "can0", 1, "a.eds", feedback_every=every))
    drive.want(Wanted.QUICK_STOP)
    for sync in range(1, 2 * every + 1):
        assert drive.fault(0.0, CONSUMER_S) is DriveFault.NONE
        drive.expect()
        drive.settle()
        assert drive.lost == sync // every
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.FEEDBACK_LOST


def test_a_quick_stop_forgets_nothing_of_what_was_wrong():
    drive = enabled()
    tell(drive, QSA)
    drive.want(Wanted.QUICK_STOP)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.STATE_LOST


def test_what_a_drive_tells_of_every_second_sync_may_be_older_than_the_wish_to_enable_it():
    drive = Drive(NodeSettings("X", "can0", 1, "a.eds", feedback_every=2))
    drive.want(Wanted.ENABLED)
    for _ in range(STALE_FEEDBACKS):
        assert not drive.following
        drive.expect()
        tell(drive, OE | FOLLOWS)
        drive.settle()
    tell(drive, OE | FOLLOWS)
    assert drive.following


def test_a_silent_drive_that_never_left_its_boot_up_is_stopped_and_one_never_heard_is_lost():
    for heartbeats, fault in ((b"\0", DriveFault.NODE_STOPPED), (b"", DriveFault.FEEDBACK_LOST)):
        drive = new_drive()
        for state in heartbeats:
            drive.receive(0x701, memoryview(bytes([state])), 0.0)
        drive.want(Wanted.ENABLED)
        for _ in range(2):
            drive.expect()
            drive.settle()
        assert drive.fault(0.0, CONSUMER_S) is fault


def test_a_heartbeat_is_overdue_after_its_time_and_not_with_it():
    drive = enabled()
    drive.receive(0x701, memoryview(b"\x05"), 1.0)
    for now_s, fault in ((1.25, DriveFault.NONE), (math.nextafter(1.25, 2.0), DriveFault.HEARTBEAT_LOST)):
        assert drive.fault(now_s, 0.25) is drive.out_of_sight(now_s, 0.25) is fault


@pytest.mark.parametrize("side", [-1, 1])
def test_only_what_is_beyond_the_part_at_rest_is_a_following_error(side):
    window = FollowingWindow(rest_counts=100.0, ticks=1)
    drive = Drive(NodeSettings("X", "can0", 1, "a.eds", following=window))
    drive.want(Wanted.ENABLED)
    tell(drive, OE | FOLLOWS, 1000)
    drive.settle()
    for off, fault in ((0, DriveFault.NONE), (100, DriveFault.NONE), (101, DriveFault.FOLLOWING_ERROR)):
        for _ in range(2):  # the setpoint is latched, and reached
            sent(drive, 1000)
            drive.expect()
        tell(drive, OE | FOLLOWS, 1000 + side * off)
        drive.settle()
        assert drive.fault(0.0, CONSUMER_S) is fault
        assert drive.following_error.actual == (-side * off if fault is not DriveFault.NONE else 0)


def test_enabling_takes_one_step_per_statusword_and_none_by_itself():
    drive = new_drive()
    drive.want(Wanted.ENABLED)
    for statusword, answer in [(SOD, 0x06), (RTSO, 0x07), (SO, 0x0F), (OE, 0x0F)]:
        tell(drive, statusword)
        for _ in range(5):  # without a new statusword the answer stays, however long it takes
            assert sent(drive)[0] == answer
    assert drive.state is State.OPERATION_ENABLED


def test_until_the_drive_follows_it_is_sent_its_own_position():
    drive = new_drive()
    drive.want(Wanted.ENABLED)
    for position, statusword in enumerate([SOD, RTSO, SO, OE, OE]):
        tell(drive, statusword, position)
        assert sent(drive, 777)[1] == position
        assert not drive.following
    tell(drive, OE | FOLLOWS, 5)
    assert drive.following
    assert sent(drive, 777)[1] == 777


def test_a_drive_enabled_again_at_once_is_not_taken_for_enabled_by_what_it_said_before():
    drive = enabled()
    drive.want(Wanted.OFF)
    sent(drive)
    drive.want(Wanted.ENABLED)
    for statusword in (OE | FOLLOWS, SO, OE, OE | FOLLOWS):  # of before; off; on its way; there
        drive.expect()
        tell(drive, statusword)
        drive.settle()
        sent(drive)
        assert drive.fault(0.0, CONSUMER_S) is DriveFault.NONE
    drive.expect()
    tell(drive, OE | FOLLOWS)
    assert drive.following
    tell(drive, SO)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.STATE_LOST


def test_quick_stop_acts_with_the_next_frame_without_waiting_for_feedback():
    drive = enabled()
    drive.want(Wanted.QUICK_STOP)
    assert sent(drive)[0] == 0x02


@pytest.mark.parametrize(
    ("statusword", "fault", "reason"),
    [
        (SOD, DriveFault.TORQUE_OFF, "no fault, yet off: somebody took the torque"),
        (RTSO, DriveFault.STATE_LOST, "no reason to be seen"),
        (SO, DriveFault.STATE_LOST, "no reason to be seen"),
        (QSA, DriveFault.STATE_LOST, "its own quick stop"),
        (QSA | cia402.INTERNAL_LIMIT, DriveFault.LIMIT_SWITCH, "stopped by a limit"),
        (FAULT, DriveFault.STATE_LOST, "the emergency message was lost"),
        (FAULT | cia402.FOLLOWING_ERROR, DriveFault.FOLLOWING_ERROR, "bit 13 tells"),
    ],
)
def test_dropping_out_of_operation_is_named_and_is_not_enabled_again(statusword, fault, reason):
    drive = enabled()
    tell(drive, statusword, 1234)
    assert drive.fault(0.0, CONSUMER_S) is fault, reason
    assert sent(drive, 9) == (0x02, 1234)
    tell(drive, OE | FOLLOWS, 1235)  # whatever it says now
    assert drive.fault(0.0, CONSUMER_S) is fault
    assert sent(drive, 9) == (0x02, 1235)


def test_to_stop_following_in_operation_is_a_lost_state_too():
    drive = enabled()
    tell(drive, OE)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.STATE_LOST


def test_a_drive_that_catches_up_at_its_own_limit_is_followed_further():
    drive = enabled()
    tell(drive, OE | cia402.INTERNAL_LIMIT, 1000)  # after a lost setpoint at full speed
    assert drive.following and sent(drive, 1500) == (0x0F, 1500)
    assert drive.fault(0.0, 0.1) is DriveFault.NONE
    tell(drive, OE, 1000)  # without a limit of its own it does not follow
    assert not drive.following and drive.fault(0.0, 0.1) is DriveFault.STATE_LOST


def test_a_limit_alone_does_not_make_a_drive_follow():
    drive = new_drive()
    drive.want(Wanted.ENABLED)
    for statusword in (SOD, RTSO, SO, OE | cia402.INTERNAL_LIMIT):
        tell(drive, statusword, 7)
    assert not drive.following


def test_not_yet_enabled_is_no_lost_state():
    drive = new_drive()
    drive.want(Wanted.ENABLED)
    for statusword in (SOD, RTSO, SO, SOD, OE):
        tell(drive, statusword)
        assert drive.fault(0.0, CONSUMER_S) is DriveFault.NONE


def test_after_off_a_lost_state_is_forgotten_and_the_drive_steps_down():
    drive = enabled()
    tell(drive, QSA)
    drive.want(Wanted.OFF)
    tell(drive, QSA | cia402.TARGET_REACHED)
    assert sent(drive)[0] == 0x00
    tell(drive, SOD)
    drive.want(Wanted.ENABLED)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.NONE
    assert sent(drive)[0] == 0x06


def test_a_reset_makes_one_rising_edge_per_request():
    drive = new_drive()
    tell(drive, FAULT)
    drive.want(Wanted.RESET)
    words = []
    for _ in range(4):
        words.append(sent(drive)[0])
        tell(drive, FAULT)
    assert words == [0x80] * 4
    drive.want(Wanted.RESET)
    words = []
    for _ in range(4):
        words.append(sent(drive)[0])
        tell(drive, FAULT)
    assert words == [0x00, 0x80, 0x80, 0x80]
    tell(drive, SOD)
    assert sent(drive)[0] == 0x00


def test_a_reset_of_a_drive_without_fault_steps_it_down():
    drive = enabled()
    drive.want(Wanted.RESET)
    assert sent(drive)[0] == 0x07


def test_feedback_that_comes_late_in_a_tick_without_sync_ends_the_row():
    drive = enabled()
    drive.settle()
    drive.expect()
    drive.settle()  # missed
    tell(drive, OE | FOLLOWS)  # it comes in a tick that sent no SYNC
    drive.settle()
    drive.expect()
    drive.settle()
    assert (drive.lost, drive.fault(0.0, CONSUMER_S)) == (2, DriveFault.NONE)


def test_one_lost_feedback_is_counted_and_the_second_in_a_row_is_a_fault():
    drive = enabled()
    for came, missing, fault in [
        (True, 0, DriveFault.NONE),
        (False, 1, DriveFault.NONE),
        (True, 1, DriveFault.NONE),
        (False, 2, DriveFault.NONE),
        (False, 3, DriveFault.FEEDBACK_LOST),
    ]:
        drive.expect()
        if came:
            tell(drive, OE | FOLLOWS)
        drive.settle()
        assert drive.lost == missing
        assert drive.fresh is came
        assert drive.fault(0.0, CONSUMER_S) is fault


def test_a_skipped_sync_owes_no_feedback():
    drive = enabled()
    drive.expect()
    tell(drive, OE | FOLLOWS)
    for _ in range(5):
        drive.settle()
    assert drive.lost == 0
    assert drive.fresh


def test_a_feedback_of_wrong_length_is_counted_and_not_used():
    drive = enabled(1000)
    for count in (1, 2):
        drive.receive(0x181, memoryview(bytes(4)), 1.0)
        assert drive.malformed == count
    assert drive.position == 1000
    assert drive.position_at_s == 0.0


def test_an_emergency_is_a_fault_until_the_drive_or_the_operator_takes_it_back():
    drive = enabled()
    drive.receive(0x081, memoryview(bytes.fromhex("1186 20 0000000000")), 3.0)
    assert drive.fault(3.0, CONSUMER_S) is DriveFault.FOLLOWING_ERROR
    assert drive.emcy_code == 0x8611
    drive.receive(0x081, memoryview(bytes(8)), 4.0)
    assert drive.fault(4.0, CONSUMER_S) is DriveFault.NONE
    drive.receive(0x081, memoryview(bytes.fromhex("1023 02 0000000000")), 5.0)
    drive.want(Wanted.RESET)
    assert drive.emcy_code == 0


@pytest.mark.parametrize(
    ("code", "fault"),
    [
        (0x8611, DriveFault.FOLLOWING_ERROR),
        (0x8612, DriveFault.LIMIT_SWITCH),
        (0x9000, DriveFault.TORQUE_OFF),
        (0x2310, DriveFault.EMCY),
        (0x8130, DriveFault.EMCY),
        (0xFF01, DriveFault.EMCY),
    ],
)
def test_an_emergency_code_names_the_fault(code, fault):
    drive = enabled()
    drive.receive(0x081, memoryview(code.to_bytes(2, "little") + bytes(6)), 3.0)
    assert drive.fault(3.0, CONSUMER_S) is fault


def test_the_first_of_several_emergencies_is_the_cause_and_stays_until_all_are_gone():
    drive = enabled()
    for message in ("1023 03 0000000000", "1186 23 0000000000", "0000 02 0000000000"):
        drive.receive(0x081, memoryview(bytes.fromhex(message)), 3.0)
        assert drive.emcy_code == 0x2310
        assert drive.fault(3.0, CONSUMER_S) is DriveFault.EMCY
    drive.receive(0x081, memoryview(bytes(8)), 3.0)
    assert drive.fault(3.0, CONSUMER_S) is DriveFault.NONE


@pytest.mark.parametrize("length", range(9))
def test_an_emergency_of_any_length_is_no_exception(length):
    drive = enabled()
    for count in (1, 2):
        drive.receive(0x081, memoryview(b"\xff" * length), 3.0)
        assert drive.malformed == (count if length < 2 else 0)


def test_heartbeats_are_watched_from_the_first_one_on():
    drive = enabled()
    assert drive.fault(100.0, CONSUMER_S) is DriveFault.NONE
    drive.receive(0x701, memoryview(b"\x05"), 100.0)
    assert drive.fault(100.19, CONSUMER_S) is DriveFault.NONE
    assert drive.fault(100.21, CONSUMER_S) is DriveFault.HEARTBEAT_LOST


@pytest.mark.parametrize(
    ("state", "fault", "reason"),
    [
        (0, DriveFault.NODE_RESET, "restarted"),
        (4, DriveFault.NODE_STOPPED, "stopped"),
        (127, DriveFault.NODE_STOPPED, "pre-operational"),
    ],
)
def test_a_drive_that_leaves_operational_is_lost_though_it_still_beats(state, fault, reason):
    drive = enabled()
    drive.receive(0x701, memoryview(b"\x05"), 1.0)
    drive.receive(0x701, memoryview(bytes([state])), 1.1)
    assert drive.fault(1.1, CONSUMER_S) is fault, reason
    drive.receive(0x701, memoryview(b"\x05"), 1.2)  # started again by somebody: what it has forgotten is lost
    assert drive.fault(1.2, CONSUMER_S) is fault, reason


def test_a_restart_is_named_before_the_feedback_that_it_costs():
    drive = enabled()
    for _ in range(3):
        drive.expect()
        drive.settle()
    assert drive.fault(1.0, CONSUMER_S) is DriveFault.FEEDBACK_LOST
    drive.receive(0x701, memoryview(b"\0"), 1.1)
    assert drive.fault(1.1, CONSUMER_S) is DriveFault.NODE_RESET


def test_a_restart_after_an_emergency_is_not_hidden_by_it():
    drive = enabled()
    drive.receive(0x081, memoryview(b"\x00\x90\x01\0\0\0\0\0"), 0.0)
    assert drive.out_of_sight(0.0, CONSUMER_S) is DriveFault.NONE
    drive.receive(0x701, memoryview(bytes([pdo.NMT_BOOT_UP])), 0.1)
    assert drive.fault(0.1, CONSUMER_S) is DriveFault.TORQUE_OFF  # the cause
    assert drive.out_of_sight(0.1, CONSUMER_S) is DriveFault.NODE_RESET  # what it has cost


def test_a_heartbeat_older_than_the_start_command_is_held_against_nobody():
    drive = new_drive()
    drive.receive(0x701, memoryview(b"\0"), 0.5)
    drive.receive(0x701, memoryview(b"\x7f"), 0.6)
    drive.want(Wanted.ENABLED)
    assert drive.fault(0.61, CONSUMER_S) is DriveFault.NONE
    drive.receive(0x701, memoryview(b"\x7f"), 0.65)
    assert drive.fault(0.65, CONSUMER_S) is DriveFault.NODE_STOPPED


def test_nothing_is_judged_while_nothing_is_wanted():
    drive = new_drive()
    drive.receive(0x081, memoryview(bytes.fromhex("3081 10 0000000000")), 0.0)
    for _ in range(3):
        drive.expect()
        drive.settle()
    assert drive.fault(100.0, CONSUMER_S) is DriveFault.NONE


def test_a_setpoint_outside_of_int32_is_not_sent():
    drive = enabled()
    assert sent(drive, 5)[1] == 5
    for count, beyond in enumerate((INT32_MAX + 1, INT32_MIN - 1), 1):
        assert sent(drive, beyond)[1] == 5
        assert drive.refused == count
    for end in (INT32_MAX, INT32_MIN):
        assert sent(drive, end)[1] == end


def test_homing_sets_the_start_bit_in_operation_only_and_sends_the_actual_position():
    drive = new_drive()
    drive.want(Wanted.ENABLED)
    drive.homing(True)
    tell(drive, SO)
    assert sent(drive)[0] == 0x0F
    tell(drive, OE, 42)
    assert sent(drive, 777) == (0x1F, 42)


def test_an_old_attained_bit_is_not_taken_for_this_homing():
    drive = enabled()
    drive.homing(True)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.NONE
    done = OE | cia402.HOMING_ATTAINED | cia402.TARGET_REACHED
    for statusword in (done, done, OE, OE):
        tell(drive, statusword)
        sent(drive)
        assert not drive.homing_done
    tell(drive, OE | cia402.HOMING_ATTAINED)  # attained, still moving
    assert not drive.homing_done
    tell(drive, done)
    assert drive.homing_done
    drive.homing(False)
    assert sent(drive)[0] == 0x0F
    assert not drive.following  # bit 12 still means "attained"
    drive.resume_cyclic()
    assert drive.following


def homing(position: int = 0) -> Drive:
    """Its start bit is out, and an earlier homing's "attained" has gone."""
    window = FollowingWindow(in_position_counts=2)
    drive = Drive(NodeSettings("X", "can0", 1, "a.eds", following=window))
    drive.want(Wanted.ENABLED)
    drive.homing(True)
    tell(drive, OE, position)
    sent(drive)
    tell(drive, OE, position)
    return drive


ATTAINED = OE | cia402.HOMING_ATTAINED | cia402.TARGET_REACHED


def test_attained_counts_where_the_motor_has_stood_for_some_feedbacks():
    drive = homing(1000)
    for position in (1600, 1603, 1606, 1609, 1612):  # a count more than standing each
        tell(drive, ATTAINED, position)
        assert not drive.homing_done
    for position, done in ((1614, False), (1612, False), (1612, True)):
        tell(drive, ATTAINED, position)
        assert drive.homing_done is done


def test_a_motor_that_has_not_moved_at_all_must_have_stood_as_long():
    drive = homing()
    found = []
    for _ in range(STOOD_FEEDBACKS - 1):  # the one that told the begin was the first
        tell(drive, ATTAINED, 0)
        found.append(drive.homing_done)
    assert found == [False] * (STOOD_FEEDBACKS - 2) + [True]


def test_what_is_told_before_the_start_bit_has_gone_out_is_no_begin_of_homing():
    drive = new_drive()
    drive.want(Wanted.ENABLED)
    drive.homing(True)
    for _ in range(STALE_STATUSWORDS):
        tell(drive, OE)
    for _ in range(STALE_STATUSWORDS):
        sent(drive)
        tell(drive, ATTAINED)
        assert not drive.homing_done
    tell(drive, ATTAINED)  # so many later it cannot be of an earlier homing
    assert drive.homing_done


def test_a_homing_error_ends_homing_without_done():
    drive = enabled()
    drive.homing(True)
    for statusword in (OE, OE, OE | cia402.HOMING_ERROR):
        tell(drive, statusword)
        sent(drive)
    assert drive.homing_error
    assert not drive.homing_done


def test_a_homing_drive_that_a_stranger_puts_into_another_mode_is_lost():
    drive = enabled()
    drive.homing(True)
    tell_mode = drive.handlers[pdo.tpdo(drive.settings.mode_tpdo, 1)]
    for count in (1, 2):
        tell_mode(memoryview(b"\x06\x00"), 0.0)
        assert drive.malformed == count
    tell_mode(memoryview(b"\x06"), 0.0)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.NONE
    tell_mode(memoryview(b"\x01"), 0.0)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.MODE_LOST


def test_changing_the_mode_in_operation_is_no_lost_state_when_announced():
    drive = enabled()
    drive.leave_cyclic()
    tell(drive, OE)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.NONE


def test_the_profile_names_the_pdos():
    drive = Drive(NodeSettings("X", "can0", 1, "a.eds", profile=replace(GENERIC, rpdo=3, tpdo=4)))
    drive.want(Wanted.ENABLED)
    assert not drive.receive(0x281, memoryview(pdo.FEEDBACK.pack(SOD, 5)), 0.0)
    assert drive.receive(0x481, memoryview(pdo.FEEDBACK.pack(SOD, 5)), 0.0)
    can_id, data = pdo.unpack(drive.frame(0, 0.0))
    assert (can_id, pdo.COMMAND.unpack(data)) == (0x401, (0x06, 5))


def test_interpolated_position_is_started_in_operation_and_followed_from_then_on():
    drive = Drive(NodeSettings("X", "can0", 1, "a.eds", profile=replace(GENERIC, mode=CyclicMode.IP)))
    drive.want(Wanted.ENABLED)
    for statusword, answer in [(SOD, 0x06), (RTSO, 0x07), (SO, 0x0F), (OE, 0x1F)]:
        tell(drive, statusword, 42)
        assert sent(drive, 777) == (answer, 42)
    tell(drive, OE | FOLLOWS, 42)
    assert sent(drive, 777) == (0x1F, 777)
    drive.want(Wanted.QUICK_STOP)
    assert sent(drive)[0] == 0x02


def test_homing_of_a_drive_with_interpolated_position_makes_its_own_edge():
    drive = Drive(NodeSettings("X", "can0", 1, "a.eds", profile=replace(GENERIC, mode=CyclicMode.IP)))
    drive.homing(True)
    drive.want(Wanted.ENABLED)
    words = []
    for statusword in (SOD, RTSO, SO, OE):
        tell(drive, statusword)
        words.append(sent(drive)[0])
    assert words == [0x06, 0x07, 0x0F, 0x1F]
    drive.homing(False)
    assert sent(drive)[0] == 0x0F  # in homing mode still: no bit 4


def feed_forward_drive(**profile):
    settings = NodeSettings("X", "can0", 1, "a.eds", feed_forward=True, profile=replace(GENERIC, **profile))
    drive = Drive(settings)
    drive.want(Wanted.ENABLED)
    return drive


def test_feed_forward_sends_the_slope_of_the_line_to_the_target():
    drive = feed_forward_drive()
    tell(drive, OE | FOLLOWS, 100)
    for setpoint, velocity in ((100, 50_000), (110, 5_000), (110, 0), (90, -10_000)):
        can_id, data = pdo.unpack(drive.frame(setpoint, 0.0))
        assert can_id == 0x201
        assert pdo.TARGET.unpack(data) == (setpoint, velocity)


def test_feed_forward_of_a_drive_that_does_not_follow_is_nothing():
    drive = feed_forward_drive()
    tell(drive, OE, 100)
    drive.frame(5, 0.0)
    tell(drive, OE, 120)
    assert pdo.TARGET.unpack(pdo.unpack(drive.frame(5, 0.0))[1]) == (120, 0)


def test_with_feed_forward_the_controlword_goes_alone_when_it_changes_again_and_with_the_heartbeat():
    drive = feed_forward_drive()
    words = []
    for i, statusword in enumerate([SOD, SOD, SOD, RTSO, *[SO] * 60]):
        tell(drive, statusword)
        drive.frame(0, i * 0.002)
        frame = drive.event_frame(i * 0.002, 0.05)
        if frame is not None:
            can_id, data = pdo.unpack(frame)
            assert can_id == 0x301
            words.append((i, data[0]))
    assert words[:5] == [(0, 0x06), (1, 0x06), (3, 0x07), (4, 0x0F), (5, 0x0F)]
    assert [i for i, _ in words[5:]] == pytest.approx([30, 55], abs=2)


def test_with_feed_forward_the_first_controlword_goes_out_though_it_is_the_one_of_a_start():
    drive = Drive(NodeSettings("X", "can0", 1, "a.eds", feed_forward=True))
    assert pdo.unpack(drive.event_frame(0.0, 0.25)) == (0x301, bytes(2))
    assert drive.event_frame(math.nextafter(0.25, 0.0), 0.25) is None
    assert drive.event_frame(0.25, 0.25) is not None


def test_a_reset_with_feed_forward_makes_one_edge_per_request():
    drive = feed_forward_drive()
    tell(drive, FAULT)
    sequence = []
    for request in (True, False, False, True, False, False):
        if request:
            drive.want(Wanted.RESET)
        frame = drive.event_frame(0.0, 0.05)
        sequence.append(None if frame is None else pdo.unpack(frame)[1][0])
        tell(drive, FAULT)
    assert sequence == [0x80, 0x80, None, 0x00, 0x80, 0x80]


def test_a_gravity_axis_leaves_a_quick_stop_that_stays_by_way_of_operation():
    drive = Drive(NodeSettings("Z", "can0", 1, "a.eds", brake=True))
    drive.want(Wanted.ENABLED)
    tell(drive, OE | FOLLOWS, 42)
    drive.want(Wanted.QUICK_STOP)
    tell(drive, QSA, 42)
    assert sent(drive, 7)[0] == 0x02
    tell(drive, QSA | cia402.TARGET_REACHED, 42)
    assert sent(drive, 7) == (0x02, 42)
    drive.want(Wanted.OFF)
    for statusword, answer in [
        (QSA | cia402.TARGET_REACHED, 0x0F), (OE | FOLLOWS, 0x07), (SO, 0x06), (RTSO, 0x00), (SOD, 0x00)
    ]:  # fmt: skip
        tell(drive, statusword, 42)
        assert sent(drive, 7) == (answer, 42)


def test_feedback_every_third_sync_is_owed_three_syncs_after_it_was_last_heard():
    drive = Drive(NodeSettings("X", "can0", 1, "a.eds", feedback_every=3))
    drive.want(Wanted.ENABLED)
    tell(drive, OE | FOLLOWS)
    faults = []
    for _ in range(7):
        drive.expect()
        drive.settle()
        faults.append(drive.fault(0.0, CONSUMER_S))
    assert faults == [DriveFault.NONE] * 6 + [DriveFault.FEEDBACK_LOST]
    assert drive.lost == 2


def test_any_sequence_of_statuswords_and_wishes_leaves_a_coherent_drive():
    import random

    seed = random.randrange(2**32)
    source = random.Random(seed)
    drive = new_drive()
    for _ in range(3000):
        match source.randrange(4):
            case 0:
                drive.want(source.choice(list(Wanted)))
            case 1:
                drive.homing(source.random() < 0.5)
            case 2:
                drive.resume_cyclic()
            case _:
                tell(drive, source.choice([SOD, RTSO, SO, OE, QSA, FAULT]) | source.randrange(8) << 10, 7)
        word, target = sent(drive, 99)
        about = f"seed {seed}"
        assert target == (99 if drive.following else drive.position), about
        assert word & 0x80 == 0 or (drive.state is State.FAULT and drive.wanted is Wanted.RESET), about
        assert word != 0x0F or drive.wanted is Wanted.ENABLED, about
        assert not drive.following or drive.state is State.OPERATION_ENABLED, about


def test_feed_forward_is_in_the_units_that_commissioning_has_read():
    """4096 counts a turn at 2 ms: 2048 counts a tick are 1 024 000 counts/s, 15 000 1/min."""
    settings = NodeSettings("X", "can", 1, "", feed_forward=True, velocity_units=60 / 4096)
    drive = Drive(settings)
    drive.following = True
    assert pdo.TARGET.unpack_from(drive.frame(2048, 0.0), 8) == (2048, 15_000)
    drive.set_velocity_units(1.0)
    assert pdo.TARGET.unpack_from(drive.frame(0, 0.0), 8) == (0, -1_024_000)
