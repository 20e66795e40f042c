"""Command against position, on simulated drives that notice nothing by themselves."""

from __future__ import annotations

import math
from random import Random

import pytest
from support.drives.group_bench import GroupBench, T, nodes

from drives import pdo
from drives.cia402 import Wanted
from drives.cyclic.drive import Drive
from drives.cyclic.drive_fault import DriveFault
from drives.cyclic.following_error import AT_SPEED, FORGETS, LEARN_S, MEASURE_EVERY, OUTLIVES, FollowingError
from drives.settings import FollowingWindow

SPEED = 40_000_000.0  # counts/s: 200 mm/s at 200 000 counts a mm
REST = 80_000.0  # 0.4 mm
WINDOW = FollowingWindow(REST, 0.02, 8_000.0, 3, SPEED, tightens=True)
REST_OF_LOOP = 1000.0
RAMP = 50  # ticks to full speed
FULL = round(SPEED * T)


def bench_of(names: str = "XY", window: FollowingWindow = WINDOW, **changes: object) -> GroupBench:
    bench = GroupBench(nodes(names, following=window, **changes))
    bench.enable()
    return bench


def run(bench: GroupBench, ticks: int, share: float = 1.0, axis: int = 0) -> None:
    """Up to a share of full speed and on; ends with the first fault."""
    for i in range(ticks):
        bench.setpoints[axis] += round(FULL * share * min(1.0, (i + 1) / RAMP))
        bench.tick()
        if bench.fault[0] is not DriveFault.NONE:
            return


def lose(bench: GroupBench, node: int, *delays: float) -> None:
    bench.rig.buses["can"].tamper = lambda _at, can_id, _frame: delays if can_id == 0x200 + node else (0.0,)


def off(bench: GroupBench, axis: int = 0) -> float:
    """Where the motor is and where it was told to be: what the bus takes is counted by the observer."""
    return abs(bench.setpoints[axis] - bench.devices[axis].axis.servo.position)


@pytest.mark.parametrize("share", [1.0, 0.1, 0.01, 0.001])
@pytest.mark.parametrize("axis", [0, 1])
def test_setpoints_that_are_lost_for_good_are_a_following_error(share: float, axis: int) -> None:
    bench = bench_of()
    run(bench, 150, share, axis)
    before = off(bench, axis)
    lose(bench, axis + 1)
    per_tick = round(FULL * share)
    for _ in range(3000):
        bench.setpoints[axis] += per_tick
        bench.tick()
        if bench.fault[0] is not DriveFault.NONE:
            break
    # A slow axis' drive misses its setpoints (1400h:05) before it is off by its window.
    slow = bench.fault == (DriveFault.SETPOINTS_LOST, axis) and share < 0.1
    assert slow or bench.fault == (DriveFault.FOLLOWING_ERROR, axis)
    assert off(bench, axis) <= before + REST + WINDOW.speed_s / T * per_tick + 10 * per_tick
    shown = bench.group.drives[axis].following_error
    assert slow or shown.actual > shown.window >= REST


def test_at_rest_an_axis_that_is_pushed_away_is_noticed() -> None:
    bench = bench_of()
    bench.tick(20)
    bench.devices[1].axis.servo.shift(-2.0 * REST)
    lose(bench, 2)
    bench.tick(10)
    assert bench.fault == (DriveFault.FOLLOWING_ERROR, 1)


def test_setpoints_that_come_late_for_good_are_a_following_error() -> None:
    bench = bench_of()
    lose(bench, 1, 0.04)
    run(bench, 400)
    assert bench.fault == (DriveFault.FOLLOWING_ERROR, 0)


def test_a_lost_drive_is_told_its_own_position_and_quick_stop_so_that_nothing_jumps() -> None:
    bench = bench_of()
    run(bench, 150)
    lose(bench, 1)
    run(bench, 400)
    assert bench.fault == (DriveFault.FOLLOWING_ERROR, 0)
    bench.rig.buses["can"].tamper = None
    at = bench.devices[0].axis.servo.position
    bench.tick(100)
    drive = bench.group.drives[0]
    assert drive.setpoint == drive.position and not drive.following
    assert abs(bench.devices[0].axis.servo.position - at) < REST


@pytest.mark.parametrize("seed", range(5))
def test_healthy_motion_with_reversals_and_stops_stays_within_half_of_its_window(seed: int) -> None:
    random = Random(seed)
    bench = bench_of(feedback_every=random.choice((1, 1, 2, 5)), feed_forward=random.random() < 0.3)
    speed, worst = 0.0, 0.0
    for _ in range(12):
        target = random.choice((0.0, random.uniform(-1.0, 1.0), 1.0, -1.0)) * FULL
        for _ in range(random.randrange(20, 200)):
            speed += max(-FULL / RAMP, min(FULL / RAMP, target - speed))
            bench.setpoints[0] += round(speed)
            bench.tick()
            error = bench.group.drives[0].following_error
            worst = max(worst, abs(error.actual) / error.window) if error.window else worst
            assert bench.fault == (DriveFault.NONE, -1), seed
    assert worst < 0.6, worst


def test_a_default_is_tightened_to_twice_what_was_measured_and_a_given_one_is_not() -> None:
    widths = {}
    for tightens in (True, False):
        bench = bench_of("X", FollowingWindow(REST, 0.02, 8_000.0, 3, SPEED, tightens))
        run(bench, 800)
        error = bench.group.drives[0].following_error
        widths[tightens] = (error.window - REST) / FULL
        lag = error.actual / FULL
    assert widths[False] == pytest.approx(0.02 / T)
    assert widths[True] == pytest.approx(max(2.0, 2.0 * lag), rel=0.01)


def first_order(error: FollowingError, speeds: list[float], lag_s: float) -> float:
    """The largest share of the window that a position loop of gain 1 / lag_s takes, by itself."""
    command, position, worst = 0.0, 0.0, 0.0
    for k, speed in enumerate(speeds):
        moved = speed * T
        command += moved
        position += (command - position) * (1.0 - math.exp(-T / lag_s))
        lag = round(command - position)
        if abs(lag) > REST_OF_LOOP:
            error.beyond(lag, round(moved))
            worst = max(worst, abs(error.actual) / error.window)
        if k % MEASURE_EVERY == 0:
            error.measure(lag, round(moved))
    return worst


@pytest.mark.parametrize("stop_ticks", [1, 10, 50, 200])
def test_the_lag_of_a_slow_loop_that_has_stopped_is_still_within_the_window(stop_ticks: int) -> None:
    """What is left of it at rest was made by a speed that is gone; the loop's lag is half of the window."""
    speeds = [SPEED] * 200 + [SPEED * (1.0 - (i + 1) / stop_ticks) for i in range(stop_ticks)] + [0.0] * 200
    error = FollowingError(FollowingWindow(REST_OF_LOOP, 0.02, 10.0, 3, SPEED), T)
    assert 0.4 < first_order(error, speeds, 0.01) < 1.0


def test_in_position_is_where_motion_has_led_it_and_not_on_the_way() -> None:
    bench = bench_of("X")
    drive = bench.group.drives[0]
    assert drive.in_position
    seen = []
    for i in range(100):
        bench.setpoints[0] += 20_000 if i < 30 else 0
        bench.tick()
        seen.append(drive.in_position)
    assert not any(seen[4:32])
    assert all(seen[50:])
    first = seen.index(True, 32)
    assert first > 32, "two SYNCs until a position answers"


def test_two_nodes_under_one_id_are_named() -> None:
    bench = bench_of()
    send = bench.service["can"].send
    for _ in range(20):
        send(pdo.frame(0x182, pdo.FEEDBACK.pack(0x1237, 12345)))
        bench.tick()
    assert bench.fault == (DriveFault.NODE_TWICE, 1)


def test_the_same_frame_twice_is_no_second_node() -> None:
    bench = bench_of()
    bench.rig.buses["can"].tamper = lambda _at, can_id, _f: (0.0, 0.0) if can_id == 0x182 else (0.0,)
    run(bench, 100)
    assert bench.fault == (DriveFault.NONE, -1)


@pytest.mark.parametrize("can_id", [0x201, 0x302, 0x77F])
def test_frames_under_our_own_identifiers_are_a_stranger_s(can_id: int) -> None:
    bench = bench_of()
    bench.service["can"].send(pdo.frame(can_id, b"\x0f\0\0\0\0\0"[: 1 if can_id == 0x77F else 6]))
    bench.tick(2)
    assert bench.fault[0] is DriveFault.FOREIGN_FRAMES


@pytest.mark.parametrize("command", [2, 0x80])
def test_a_stranger_who_stops_a_node_is_named_after_what_he_did(command: int) -> None:
    bench = bench_of()
    bench.service["can"].send(pdo.frame(pdo.NMT, bytes((command, 2))))
    bench.tick(40)
    assert bench.fault == (DriveFault.NODE_STOPPED, 1)


@pytest.mark.parametrize("mode", [1, 3, 6, 9])
@pytest.mark.parametrize("moving", [False, True])
def test_a_drive_that_a_stranger_puts_into_another_mode_is_noticed_within_100_ms(
    mode: int, moving: bool
) -> None:
    bench = bench_of()
    if moving:
        run(bench, 100, 0.2, axis=1)
    bench.write(2, 0x6060, 0, mode, 1)
    for _ in range(round(0.1 / T)):
        bench.setpoints[1] += round(0.2 * FULL) if moving else 0
        bench.tick()
        if bench.fault[0] is not DriveFault.NONE:
            break
    assert bench.fault[0] in (DriveFault.MODE_LOST, DriveFault.STATE_LOST), bench.fault
    assert bench.fault[1] == 1


def test_the_mode_that_a_drive_tells_while_it_homes_is_no_fault() -> None:
    bench = bench_of("X")
    drive = bench.group.drives[0]
    drive.leave_cyclic()
    bench.service["can"].send(pdo.frame(pdo.tpdo(drive.settings.mode_tpdo, 1), b"\x06"))
    bench.tick(2)
    assert bench.fault == (DriveFault.NONE, -1)


def test_a_mode_told_before_the_drive_is_in_operation_may_be_of_before_it_was_chosen() -> None:
    bench = GroupBench(nodes("X", following=WINDOW))
    drive = bench.group.drives[0]
    bench.group.want(Wanted.ENABLED)
    bench.service["can"].send(pdo.frame(pdo.tpdo(drive.settings.mode_tpdo, 1), b"\x06"))
    bench.until(bench.group.following)
    assert bench.fault == (DriveFault.NONE, -1)


@pytest.mark.parametrize("pattern", [(1, 3), (1, 1), (4, 1), (2, 5), (5, 2)])
def test_feedback_that_comes_late_and_in_bursts_is_neither_lag_nor_a_second_node(
    pattern: tuple[int, int],
) -> None:
    """A drive's process that the computer kept waiting: nothing for some SYNCs, then all at once."""
    settings = nodes("X", following=FollowingWindow(REST, 0.02, 8_000.0, 3, SPEED))[0]
    drive = Drive(settings, lost_after=100)
    drive.want(Wanted.ENABLED)
    waiting: list[int] = []
    sent = [0, 0, 0]
    for tick in range(200):
        late = tick > 20 and tick % sum(pattern) < pattern[0]
        if not late:
            for position in waiting:
                drive.receive(0x181, memoryview(pdo.FEEDBACK.pack(0x1237, position)), 0.0)
            waiting.clear()
        drive.settle()
        drive.expect()
        waiting.append(sent[-2])  # what the SYNC before this one latched is reached
        drive.frame(tick * FULL, 0.0)
        sent.append(drive.setpoint)
        assert drive.fault(0.0, 1.0) is DriveFault.NONE, tick
    assert drive.following


def test_two_nodes_are_named_after_a_pair_and_a_miss_too() -> None:
    drive = Drive(nodes("X")[0], lost_after=100)
    drive.want(Wanted.ENABLED)

    def sync(*positions: int) -> None:
        drive.expect()
        for position in positions:
            drive.receive(0x181, memoryview(pdo.FEEDBACK.pack(0x1237, position)), 0.0)
        drive.settle()

    for positions in ((0,), (0, 5), (), (0, 5), (0, 5), (0, 5), (0, 5)):
        assert drive.fault(0.0, 1.0) is DriveFault.NONE
        sync(*positions)
    assert drive.fault(0.0, 1.0) is DriveFault.NODE_TWICE


def test_what_a_stalled_bus_brings_later_and_later_is_no_second_node() -> None:
    """As traced when bus and controller had to wait for each other: five missed, then three at a time."""
    drive = Drive(nodes("X")[0], lost_after=100)
    drive.want(Wanted.ENABLED)
    position = 0
    for count in (1, 1, 0, 0, 0, 1, 0, 0, 1, 1, 3, 3, 2, 1, 1, 0, 2, 0, 2):
        drive.expect()
        for _ in range(count):
            position += 5
            drive.receive(0x181, memoryview(pdo.FEEDBACK.pack(0x1237, position)), 0.0)
        drive.settle()
        assert drive.fault(0.0, 1.0) is DriveFault.NONE


@pytest.mark.parametrize("every", [2, 3])
def test_what_a_late_tick_has_left_to_the_next_is_neither_lag_nor_a_second_node(every: int) -> None:
    """Woken behind its deadline a tick sends SYNC and does not listen: the next one hears two answers."""
    drive = Drive(nodes("X", following=FollowingWindow(REST, 0.0, 8_000.0, 3, SPEED))[0], lost_after=2)
    drive.want(Wanted.ENABLED)
    waiting: list[int] = []
    sent = [0, 0, 0]
    for tick in range(200):
        if tick < 20 or tick % every:
            for position in waiting:
                drive.receive(0x181, memoryview(pdo.FEEDBACK.pack(0x1237, position)), 0.0)
            waiting.clear()
            drive.settle()
        drive.expect()
        waiting.append(sent[-2])
        drive.frame(tick * FULL, 0.0)
        sent.append(drive.setpoint)
        assert drive.fault(0.0, 1.0) is DriveFault.NONE, tick
    assert drive.following and drive.lost == 0


# ---- the window by itself: 100 counts at rest, and 10 SYNCs of the speed

LARGEST = 1_000_000.0  # counts/s
LEARNS = round(LEARN_S / T / MEASURE_EVERY)


def alone(**changes: object) -> FollowingError:
    given = {"rest_counts": 100.0, "speed_s": 10 * T, "ticks": 3, "velocity_counts_s": LARGEST} | changes
    return FollowingError(FollowingWindow(**given), T)  # type: ignore[arg-type]


def window_of(error: FollowingError, moved: int) -> float:
    error.beyond(0, moved)
    return error.window


def test_of_a_drive_that_has_not_moved_nothing_is_known() -> None:
    error = alone()
    assert (error.actual, error.window, error.lag_s) == (0, 0.0, 0.0)


def test_so_many_feedbacks_in_a_row_beyond_the_window_are_an_error_and_one_within_ends_the_row() -> None:
    for ends in (lambda error: error.beyond(100, 0), lambda error: error.measure(100, 0)):
        error = alone()
        assert [error.beyond(101, 0) for _ in range(2)] == [False, False]
        ends(error)
        assert [error.beyond(-101, 0) for _ in range(3)] == [False, False, True]
        assert error.actual == -101


@pytest.mark.parametrize("moved", [-10, -1, 0, 1, 10])
def test_the_window_widens_with_the_speed_whichever_way_it_goes(moved: int) -> None:
    assert window_of(alone(), moved) == pytest.approx(100.0 + 10.0 * abs(moved))
    error = alone()
    error.measure(0, moved)
    assert window_of(error, 0) == pytest.approx(100.0 + 10.0 * abs(moved))


def test_the_speed_that_counts_dies_away_with_three_times_the_window_s_own_time() -> None:
    error = alone()
    assert window_of(error, 10) == pytest.approx(200.0)
    assert window_of(error, 5) == pytest.approx(200.0)  # the largest of late
    for n in (1, 2, 3):
        error.measure(0, 0)
        late = math.exp(-n * MEASURE_EVERY * T / (OUTLIVES * 10 * T))
        assert window_of(error, 0) == pytest.approx(100.0 + 100.0 * late)


def test_the_lag_is_the_best_line_through_what_was_measured_and_the_newest_counts_most() -> None:
    error = alone()
    for way in (1, -1):
        error.measure(way * 20, way * 10)
        assert error.lag_s == pytest.approx(2 * T)
    error = alone()
    error.measure(20, 10)
    error.measure(0, 0)  # at rest there is nothing to measure
    error.measure(-60, -20)
    assert error.lag_s == pytest.approx(T * (FORGETS * 200 + 1200) / (FORGETS * 100 + 400))


@pytest.mark.parametrize("way", [-1, 1])
def test_a_second_at_speed_tightens_the_default_to_twice_the_lag_seen_and_enabling_forgets_it(
    way: int,
) -> None:
    error = alone(tightens=True)
    error.beyond(10_000, 100)
    error.measure(10_000, 100)  # what is beyond is no measure of a healthy lag
    error.beyond(0, 0)
    for _ in range(2):
        for _ in range(LEARNS - 1):
            error.measure(way * 300, way * 100)
        assert window_of(error, 100) == pytest.approx(1100.0)
        error.measure(way * 100, way * 100)  # the largest lag counts
        assert window_of(error, 100) == pytest.approx(100.0 + 2 * 300.0)
        error.forget()
        assert window_of(error, 100) == pytest.approx(1100.0)


def test_it_is_never_tightened_below_two_syncs_of_the_speed() -> None:
    error = alone(tightens=True)
    for _ in range(LEARNS):
        error.measure(-1, 100)
    assert window_of(error, 100) == pytest.approx(300.0)


def test_slow_motion_and_an_axis_without_a_known_speed_tighten_nothing() -> None:
    slow = round(AT_SPEED * LARGEST * T)
    for error, moved in ((alone(tightens=True), slow), (alone(tightens=True, velocity_counts_s=0.0), 100)):
        for _ in range(2 * LEARNS):
            error.measure(0, moved)
        assert window_of(error, moved) == pytest.approx(100.0 + 10.0 * moved)
