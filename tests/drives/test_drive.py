"""One drive against a device model of a dozen lines: frames in, one frame out."""

import pytest

from drives import cia402, pdo
from drives.cia402 import State, Wanted
from drives.drive import Drive, DriveFault
from drives.settings import NodeSettings

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


def test_quick_stop_acts_with_the_next_frame_without_waiting_for_feedback():
    drive = enabled()
    drive.want(Wanted.QUICK_STOP)
    assert sent(drive)[0] == 0x02


@pytest.mark.parametrize("statusword", [SOD, RTSO, SO, QSA, FAULT])
def test_dropping_out_of_operation_is_a_lost_state_and_is_not_enabled_again(statusword):
    drive = enabled()
    tell(drive, statusword, 1234)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.STATE_LOST
    assert sent(drive, 9) == (0x02, 1234)
    tell(drive, OE | FOLLOWS, 1235)  # whatever it says now
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.STATE_LOST
    assert sent(drive, 9) == (0x02, 1235)


def test_to_stop_following_in_operation_is_a_lost_state_too():
    drive = enabled()
    tell(drive, OE)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.STATE_LOST


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
    drive.receive(0x181, memoryview(bytes(4)), 1.0)
    assert drive.malformed == 1
    assert drive.position == 1000
    assert drive.position_at_s == 0.0


def test_an_emergency_is_a_fault_until_the_drive_or_the_operator_takes_it_back():
    drive = enabled()
    drive.receive(0x081, memoryview(bytes.fromhex("1186 20 0000000000")), 3.0)
    assert drive.fault(3.0, CONSUMER_S) is DriveFault.EMCY
    assert (drive.emcy_code, drive.emcy_at_s) == (0x8611, 3.0)
    drive.receive(0x081, memoryview(bytes(8)), 4.0)
    assert drive.fault(4.0, CONSUMER_S) is DriveFault.NONE
    drive.receive(0x081, memoryview(bytes.fromhex("1023 02 0000000000")), 5.0)
    drive.want(Wanted.RESET)
    assert drive.emcy_code == 0


def test_heartbeats_are_watched_from_the_first_one_on():
    drive = enabled()
    assert drive.fault(100.0, CONSUMER_S) is DriveFault.NONE
    drive.receive(0x701, memoryview(b"\x05"), 100.0)
    assert drive.fault(100.19, CONSUMER_S) is DriveFault.NONE
    assert drive.fault(100.21, CONSUMER_S) is DriveFault.HEARTBEAT_LOST


@pytest.mark.parametrize(("state", "reason"), [(0, "restarted"), (4, "stopped"), (127, "pre-operational")])
def test_a_drive_that_leaves_operational_is_lost_though_it_still_beats(state, reason):
    drive = enabled()
    drive.receive(0x701, memoryview(b"\x05"), 1.0)
    drive.receive(0x701, memoryview(bytes([state])), 1.1)
    assert drive.fault(1.1, CONSUMER_S) is DriveFault.HEARTBEAT_LOST, reason


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
    assert sent(drive, 2**31)[1] == 5
    assert drive.refused == 1


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


def test_a_homing_error_ends_homing_without_done():
    drive = enabled()
    drive.homing(True)
    for statusword in (OE, OE, OE | cia402.HOMING_ERROR):
        tell(drive, statusword)
        sent(drive)
    assert drive.homing_error
    assert not drive.homing_done


def test_changing_the_mode_in_operation_is_no_lost_state_when_announced():
    drive = enabled()
    drive.leave_cyclic()
    tell(drive, OE)
    assert drive.fault(0.0, CONSUMER_S) is DriveFault.NONE


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
