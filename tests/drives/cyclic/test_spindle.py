"""A spindle's drive: frame by frame, and against the simulated one."""

import itertools
import math
from dataclasses import replace

import pytest
from support.drives.group_bench import GroupBench, T, nodes, spindle

from drives import pdo
from drives.cia402 import State, Wanted
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.spindle import MAX_AHEAD, SpindleDrive
from drives.profile import GENERIC, Supervision
from drives.pump.plan_memory import FOLLOWS
from drives.settings import SpindleSettings

OE = 0x1237
BEAT_S = 0.05
COUNTS = 4000.0  # per revolution


def enabled(**kind):
    drive = SpindleDrive(SpindleSettings("S", "can0", 10, "a.eds", COUNTS, **kind))
    drive.want(Wanted.ENABLED)
    tell(drive, 0)
    return drive


def tell(drive, speed, statusword=OE, now_s=0.0):
    drive.expect()
    assert drive.receive(0x18A, memoryview(pdo.FEEDBACK.pack(statusword, speed)), now_s)
    drive.settle()


def sent(drive, now_s):
    frame = drive.event_frame(now_s, BEAT_S)
    if frame is None:
        return None
    can_id, data = pdo.unpack(frame)
    assert can_id == 0x20A
    return pdo.COMMAND.unpack(data)


def test_in_profile_velocity_the_drive_is_told_the_end_of_its_own_ramp():
    drive = enabled(mode=3)
    sent(drive, 0.0)
    drive.want_speed(6000.0)
    assert sent(drive, T) == (0x0F, 400_000)


def test_in_cyclic_velocity_it_is_led_there_at_the_acceleration_set():
    drive = enabled(acceleration_rev_s2=50.0)
    sent(drive, 0.0)
    drive.want_speed(600.0)  # 10 rev/s: 0.2 s at 50 rev/s2
    speeds = [sent(drive, i * T)[1] for i in range(1, 101)]
    assert speeds[:3] == [400, 800, 1200]
    assert speeds[-1] == 40_000
    assert max(b - a for a, b in itertools.pairwise(speeds)) <= 401


@pytest.mark.parametrize(("counts", "sign"), [(COUNTS, 1), (-COUNTS, -1)])
def test_the_sign_of_the_counts_is_the_direction_of_m3(counts, sign):
    drive = SpindleDrive(SpindleSettings("S", "can0", 10, "a.eds", counts, mode=3))
    drive.want(Wanted.ENABLED)
    tell(drive, 0)
    drive.want_speed(60.0)
    assert sent(drive, 0.0)[1] == sign * 4000
    tell(drive, sign * 4000)
    assert drive.rev_min == pytest.approx(60.0)
    assert drive.at_speed


def test_at_speed_is_within_the_share_and_never_before_the_feedback():
    drive = enabled(mode=3, at_speed_share=0.05)
    assert drive.at_speed  # it is to stand, and stands
    drive.want_speed(600.0)
    assert not drive.at_speed
    for speed, reached in ((37_900, False), (38_100, True), (42_100, False), (-40_000, False)):
        tell(drive, speed)
        assert drive.at_speed is reached, speed
    tell(drive, 40_000)
    drive.stop()
    assert not drive.at_speed and not drive.standing
    tell(drive, 100)
    assert drive.at_speed and drive.standing


def test_one_feedback_that_comes_late_is_no_loss_of_speed_and_a_loss_of_them_is():
    drive = alone(lost_after=3, feedback_every=1)
    drive.want(Wanted.ENABLED)
    drive.want_speed(600.0)
    for misses in (0, 1, 2, 3):
        tell(drive, 40_000)
        for _ in range(misses):
            drive.expect()
            drive.settle()
        assert drive.at_speed is (misses < 3)


def test_a_drive_that_is_not_in_operation_is_at_no_speed():
    drive = enabled(mode=3)
    drive.want_speed(600.0)
    tell(drive, 40_000, 0x0233)
    assert not drive.at_speed


@pytest.mark.parametrize("wanted", [Wanted.OFF, Wanted.QUICK_STOP, Wanted.RESET])
def test_no_speed_comes_back_by_itself(wanted):
    drive = enabled(mode=3)
    drive.want_speed(600.0)
    drive.want(wanted)
    drive.want(Wanted.ENABLED)
    assert sent(drive, T)[1] == 0


def test_its_frame_goes_out_on_change_once_more_and_with_the_heartbeat():
    drive = enabled(mode=3)
    drive.want_speed(60.0)
    frames = [sent(drive, i * T) for i in range(60)]
    told = [i for i, frame in enumerate(frames) if frame]
    assert told[:2] == [0, 1]
    assert told[2:] == pytest.approx([26, 51], abs=2)


def test_enabled_while_it_coasts_it_is_led_from_where_it_is():
    drive = SpindleDrive(SpindleSettings("S", "can0", 10, "a.eds", COUNTS))
    drive.want(Wanted.ENABLED)
    tell(drive, 30_000, 0x0233)
    assert sent(drive, 0.0) == (0x0F, 30_000)
    tell(drive, 29_500)
    assert sent(drive, T)[1] == 30_000 - 400


def test_a_speed_beyond_int32_is_not_sent():
    drive = enabled(mode=3)
    drive.want_speed(1e12)
    assert sent(drive, T)[1] == 2**31 - 1


@pytest.mark.parametrize("mode", [3, 9])
def test_the_simulated_spindle_turns_both_ways_and_stops(mode):
    bench = GroupBench(nodes("XY"), spindle=spindle(mode=mode))
    bench.enable()
    bench.until(lambda: bench.spindle.state is State.OPERATION_ENABLED)
    for rev_min in (1200.0, -600.0, 0.0):
        bench.spindle.want_speed(rev_min)
        assert not bench.spindle.at_speed
        bench.until(lambda: bench.spindle.at_speed, 1500)
        bench.tick(300)
        assert bench.spindle.rev_min == pytest.approx(rev_min, abs=1.0)
    assert bench.spindle.standing
    assert bench.fault == (DriveFault.NONE, -1)
    assert bench.spindle.lost == 0


def test_a_quick_stop_of_the_group_stops_the_spindle():
    bench = GroupBench(nodes("X"), spindle=spindle())
    bench.enable()
    bench.spindle.want_speed(1200.0)
    bench.until(lambda: bench.spindle.at_speed, 1500)
    bench.group.want(Wanted.QUICK_STOP)
    bench.until(lambda: bench.spindle.standing, 1500)
    bench.group.want(Wanted.RESET)
    bench.tick(50)
    bench.group.want(Wanted.OFF)
    bench.tick(50)
    bench.enable()
    bench.tick(100)
    assert bench.spindle.standing
    assert bench.fault == (DriveFault.NONE, -1)


@pytest.mark.parametrize("supervision", [Supervision.HEARTBEAT, Supervision.GUARDING])
def test_a_silent_spindle_is_a_fault_of_the_group(supervision):
    bench = GroupBench(nodes("X"), spindle=spindle(profile=replace(GENERIC, supervision=supervision)))
    bench.enable()
    bench.tick(100)
    assert bench.fault == (DriveFault.NONE, -1)
    bench.rig.buses["can"].tamper = lambda _at, can_id, _frame: () if can_id == 0x70A else (0.0,)
    bench.until(lambda: bench.fault[0] is not DriveFault.NONE)
    assert bench.fault == (DriveFault.SPINDLE_LOST, -1)


def test_a_spindle_that_faults_is_a_fault_of_the_group_and_can_be_reset():
    bench = GroupBench(nodes("X"), spindle=spindle())
    bench.enable()
    bench.tick(50)
    bench.rig.spindle.inject(0x2310, bench.now_s)
    bench.tick(3)
    assert bench.fault == (DriveFault.SPINDLE_LOST, -1)
    for wanted in (Wanted.QUICK_STOP, Wanted.RESET, Wanted.OFF):
        bench.group.want(wanted)
        bench.tick(50)
    bench.enable()
    bench.tick(50)
    assert bench.fault == (DriveFault.NONE, -1)


def test_feedback_from_before_it_was_enabled_again_does_not_make_it_drop_out():
    drive = enabled()
    for _ in range(5):
        tell(drive, 0)
    drive.want(Wanted.OFF)
    drive.want(Wanted.ENABLED)
    tell(drive, 0)  # of before
    tell(drive, 0, 0x0233)  # switched on: off has come
    assert drive.fault(0.0, 1.0) is DriveFault.NONE
    for _ in range(5):
        tell(drive, 0)
    tell(drive, 0, 0x0233)
    assert drive.fault(0.0, 1.0) is DriveFault.STATE_LOST


def test_a_spindle_in_revolutions_per_minute_is_told_and_read_in_them():
    """4000 counts a turn: 1/min is 66.67 counts/s."""
    drive = SpindleDrive(spindle(mode=3))
    drive.set_velocity_units(60 / 4000)
    drive._feedback(memoryview(pdo.FEEDBACK.pack(0x0637, -1500)), 1.0)
    assert drive.speed == pytest.approx(-100_000.0) and drive.rev_min == pytest.approx(-1500.0)
    drive.want(Wanted.ENABLED)
    drive.want_speed(1200.0)
    drive._feedback(memoryview(pdo.FEEDBACK.pack(0x0637, 0)), 1.1)
    for now_s in (1.2, 1.3, 1.4):
        frame = drive.event_frame(now_s, 0.05)
        drive._feedback(memoryview(pdo.FEEDBACK.pack(0x0637, 1190)), now_s)
    assert frame is not None and pdo.COMMAND.unpack_from(frame, 8)[1] == 1200
    assert drive.rev_min == pytest.approx(1190.0)


def alone(lost_after=2, **kind):
    return SpindleDrive(SpindleSettings("S", "can0", 10, "a.eds", COUNTS, **kind), lost_after)


def test_before_anything_is_heard_a_spindle_claims_nothing_and_says_its_word_once():
    drive = alone()
    assert (drive.speed, drive.rev_min, drive.turns, drive.load, drive.unheard) == (0, 0, 0, 0, 0)
    assert drive.speed_at_s == -math.inf and not drive.standing and not drive.at_speed
    told = [drive.event_frame(i * 0.125, 0.5) is not None for i in range(9)]
    assert told == [i % 4 == 0 for i in range(9)]


def test_how_often_feedback_may_be_missing_is_the_settings_word():
    drive = alone(lost_after=1, feedback_every=1)
    drive.want(Wanted.ENABLED)
    drive.expect()
    drive.settle()
    assert drive.fault(0.0, 0.2) is DriveFault.FEEDBACK_LOST


def test_a_speed_asked_for_before_it_is_enabled_is_there_then():
    drive = alone(mode=3)
    drive.want_speed(600.0)
    drive.want(Wanted.ENABLED)
    tell(drive, 0)
    assert sent(drive, 0.0) == (0x0F, 40_000)


def test_a_path_leads_it_without_a_ramp_of_its_own_until_a_speed_is_asked_for():
    drive = enabled(acceleration_rev_s2=50.0)
    sent(drive, 0.0)
    for i, rev_s in enumerate((10.0, -10.0), 1):
        drive.lead(rev_s)
        assert sent(drive, i * T) == (0x0F, 4000 * rev_s)
    drive.want_speed(0.0)
    assert sent(drive, 3 * T) == (0x0F, -40_000 + 400)


def test_off_it_is_told_its_actual_speed_and_nothing_when_it_stands():
    drive = alone()
    for speed, led in ((5000, 5000), (-5000, -5000), (400, 0), (-400, 0), (401, 401)):
        tell(drive, speed, 0x250)
        assert drive.standing is (led == 0)
        assert pdo.COMMAND.unpack(pdo.unpack(drive.event_frame(0.0, 0.0))[1]) == (0, led)


def test_its_turns_go_on_where_its_counts_wrap_and_the_load_is_the_share_of_the_rated_torque():
    drive = alone(position_tpdo=2, position_per_rev=4096.0)

    def hear(data):
        drive.expect()
        assert drive.receive(0x28A, memoryview(data), 0.0)
        return drive.turns, drive.load, drive.unheard

    assert hear(pdo.TURNED.pack(2**31 - 96)) == (0.0, 0.0, 0)  # the first one heard is where it begins
    assert hear(pdo.TURNED_AND_LOAD.pack(-(2**31) + 4000, 250)) == (1.0, 0.25, 0)
    assert hear(pdo.TURNED_AND_LOAD.pack(-(2**31) + 6048, -1500)) == (1.5, -1.5, 0)
    assert hear(pdo.TURNED.pack(2**31 - 96 - 4096)) == (-1.0, 0.0, 0)
    for count in (1, 2):
        assert hear(bytes(5)) == (-1.0, 0.0, count) and drive.malformed == count


def test_which_sync_its_position_answers_is_known_where_one_is_early_lost_or_there_twice():
    drive = alone(position_tpdo=2, position_per_rev=4096.0)

    def after(positions):
        for _ in range(positions):
            drive.receive(0x28A, memoryview(pdo.TURNED.pack(0)), 0.0)
        drive.expect()
        return drive.unheard

    assert [after(n) for n in (0, 1, 1)] == [1, 1, 1]
    assert [after(n) for n in (2, 0, 1)] == [0, 1, 1]  # a late look finds the answer to its own SYNC
    assert [after(n) for n in (0, 0, 1, 1)] == [2, 3, 1, 1]  # two were lost
    assert after(2) == 0
    assert [after(1) for _ in range(MAX_AHEAD)][-2:] == [0, 1]  # so long: one was there twice


def test_a_spindle_s_feedback_of_wrong_length_is_counted_and_not_used():
    drive = enabled()
    for count in (1, 2):
        drive.receive(0x18A, memoryview(bytes(4)), 1.0)
        assert (drive.malformed, drive.speed_at_s) == (count, 0.0)


def test_its_ramp_is_the_pump_s_from_the_period_after_the_one_that_was_told_it():
    drive = enabled(acceleration_rev_s2=50.0)
    sent(drive, 0.0)
    told = {}
    for period in range(1, 140):
        wanted = 600.0 if period < 60 else 120.0
        rev_s = drive.ramp(period - 1, T).at(period)  # as the pump has it, in a plan of the tick before
        if rev_s is not None:
            assert drive.was_led(rev_s)
            told[period] = "pump", drive._sent_speed
        drive.want_speed(wanted)
        drive.ramp(period, T)
        frame = sent(drive, period * T)
        if frame is not None:
            told[period] = "tick", frame[1]
    speeds = [speed for _, speed in told.values()]
    assert [n for n, (who, _) in told.items() if who == "tick"][:1] == [1]
    assert speeds[:3] == [400, 800, 1200] and told[59] == ("pump", 23_600)
    assert told[60] == ("tick", 23_200) and told[61] == ("pump", 22_800)  # down, from what went out last
    slows = [n for n, (_, speed) in told.items() if n > 60 and speed == 8000]
    assert slows[:2] == [98, 99] and len(slows) == 3  # once more; and once a heartbeat
    late = drive.ramp(140, T)
    assert late.at(141) is None and late.value(141) == 2.0


def test_it_counts_the_syncs_in_which_it_has_been_told_one_speed():
    drive = enabled(mode=3)
    drive.want_speed(600.0)
    sent(drive, 0.0)
    drive.expect()
    assert (drive.even_syncs, drive.commanded_rev_s) == (0, 10.0)
    for _ in range(3):
        drive.expect()
    assert drive.even_syncs == 3
    drive.want_speed(660.0)
    sent(drive, T)
    assert drive.commanded_rev_s == 11.0
    drive.expect()
    assert drive.even_syncs == 0
    drive.want(Wanted.OFF)
    for _ in range(3):
        drive.expect()
    assert drive.even_syncs == 0  # it follows nothing


def test_what_a_plan_leads_is_the_pumps_to_tell_and_counts_as_told():
    drive = enabled(position_tpdo=2, position_per_rev=4096.0)
    assert drive.wire == (10, drive.settings.profile.rpdo, False) and enabled(mode=3).wire is None
    sent(drive, 0.0)
    drive.lead(10.0, True)
    assert drive.word == 0x0F | FOLLOWS and drive.event_frame(1.0, 0.05) is None
    assert drive.units_per_rev_s == 4000.0 and drive.was_led(10.0)
    assert drive._sent_speed == 40_000
    drive.want(Wanted.QUICK_STOP)
    tell(drive, 40_000)
    assert not drive.word & FOLLOWS and not drive.was_led(5.0)
    assert sent(drive, 1.1)[0] == 0x02  # a stop does not wait for a plan
