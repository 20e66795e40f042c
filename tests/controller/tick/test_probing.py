"""A probing, tick by tick: what arms it, what ends it, where the touch was, and what a touch is elsewhere.

What programs make of it is for ``tests/acceptance/test_probing.py``.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from support.machines.probing_machine import machine

from controller.motion.pieces import Sensing
from controller.state.modes import Fault, Mode
from controller.tick.probing import HOLDING, KEPT_TICKS, LATE_TICKS, MOVES_COUNTS, Phase, Probing

PROBE = 0x1  # its input's bit
T = 0.002
STEP = 10  # counts of X in a tick


class Probed:
    """X runs on by ``STEP`` counts a tick; a count is a thousandth of its unit."""

    def __init__(self, latched: bool = False) -> None:
        self.failed: list[tuple[Fault, int]] = []
        self.latches = [SimpleNamespace(touched=False, position=10**9, forgot=0) for _ in range(5)]
        for latch in self.latches:
            latch.forget = lambda one=latch: setattr(one, "forgot", one.forgot + 1)
        self.group: Any = SimpleNamespace(
            positions=[0] * 5, drives=[SimpleNamespace(probe=latch) for latch in self.latches]
        )
        self.modes: Any = SimpleNamespace(
            mode=Mode.RUNNING, running=True, fail=lambda fault, axis: self.failed.append((fault, axis))
        )
        self.follow: Any = SimpleNamespace(
            joints=(0.0,) * 5, at_rest=True, stopping=False, ahead=None, given_up=0
        )
        self.follow.give_up = lambda: setattr(self.follow, "given_up", self.follow.given_up + 1)
        encoder: Any = SimpleNamespace(real=lambda counts: tuple(q / 1000.0 for q in counts))
        self.io: Any = SimpleNamespace(inputs=0, waiting=False)
        built = machine(latched=latched)
        self.probing = Probing(built, self.group, self.modes, self.follow, encoder, self.io)

    def tick(self, ticks: int = 1, step: int = STEP) -> Phase:
        for _ in range(ticks):
            self.group.positions[0] += step
            self.probing.watch()
        return self.probing.phase

    def begin(self, **kind: Any) -> Sensing:
        sensing = sensing_of(**kind)
        self.io.inputs = 0 if sensing.on else PROBE
        self.probing.tell(sensing)
        assert self.probing.holds
        assert self.tick() is Phase.ARMED and not self.probing.holds
        return sensing

    def touch(self, sensing: Sensing) -> None:
        self.io.inputs ^= PROBE
        assert self.tick() is Phase.TOUCHED and self.probing.holds


def sensing_of(**kind: Any) -> Sensing:
    given: dict[str, Any] = {"mask": PROBE, "on": True, "ends": False, "latched": False, "latency_s": 0.0}
    return Sensing(**(given | {"late_ticks": 0} | kind))


def test_a_machine_that_has_not_probed_has_nothing_to_tell() -> None:
    probing = Probed().probing
    assert (probing.phase, probing.holds, probing.present) == (Phase.IDLE, False, True)
    assert (probing.count, probing.came, probing.touch) == (0, 0, (0.0,) * 5)
    assert {phase for phase in Phase if phase in HOLDING} == {Phase.ARMING, Phase.TOUCHED}


@pytest.mark.parametrize(("on", "fault"), [(True, Fault.PROBE_OPEN), (False, Fault.PROBE_FREE)])
def test_nothing_moves_with_a_probe_that_is_already_what_it_is_to_become(on: bool, fault: Fault) -> None:
    probed = Probed()
    probed.io.inputs = PROBE if on else 0
    probed.probing.tell(sensing_of(on=on))
    assert probed.tick() is Phase.ARMING and probed.failed == [(fault, -1)]


def test_it_is_armed_when_nothing_is_waited_for_and_what_was_stored_before_is_forgotten() -> None:
    probed = Probed(latched=True)
    probed.probing.tell(sensing_of())
    probed.io.waiting = True
    assert probed.tick() is Phase.ARMING
    probed.io.waiting, probed.modes.running = False, False
    assert probed.tick() is Phase.ARMING
    probed.modes.running = True
    assert probed.tick() is Phase.ARMED
    assert [latch.forgot for latch in probed.latches] == [1] * 5


@pytest.mark.parametrize("on", [True, False])
@pytest.mark.parametrize("latency_ticks", [0.0, 1.0, 3.25])
def test_a_touch_is_where_the_axes_were_half_a_period_and_the_input_s_latency_before_it_was_seen(
    on: bool, latency_ticks: float
) -> None:
    probed = Probed()
    probed.tick(KEPT_TICKS - 5)  # across the end of what is kept
    sensing = probed.begin(on=on, latency_s=latency_ticks * T)
    probed.tick(4)
    probed.touch(sensing)
    seen = probed.group.positions[0]
    probed.follow.at_rest = False
    assert probed.tick(20) is Phase.TOUCHED
    probed.follow.at_rest = probed.follow.stopping = True
    assert probed.tick() is Phase.TOUCHED
    probed.follow.stopping = False
    assert probed.tick() is Phase.IDLE
    assert (probed.probing.count, probed.probing.came, probed.follow.given_up) == (1, 1, 1)
    x, *others = probed.probing.touch
    assert x == pytest.approx((seen + (0.5 - latency_ticks) * STEP) / 1000.0) and others == [0.0] * 4
    assert not probed.failed


def test_a_touch_at_rest_is_told_when_the_frames_on_their_way_have_come() -> None:
    probed = Probed()
    probed.touch(probed.begin())
    phases = [probed.tick(step=0) for _ in range(LATE_TICKS)]
    assert phases == [Phase.TOUCHED] * (LATE_TICKS - 1) + [Phase.IDLE]


@pytest.mark.parametrize("late", [0, 2])
def test_a_way_without_a_touch_is_missed_once_the_frames_on_their_way_have_come(late: int) -> None:
    wait = LATE_TICKS + late
    for count in (1, 2):
        probed = Probed()
        for _ in range(count):
            probed.follow.joints = (float(count),) * 5
            probed.begin(late_ticks=late)
            probed.probing.tell(sensing_of(ends=True))
            assert [probed.tick() for _ in range(wait)] == [Phase.ENDING] * wait
            assert probed.tick() is Phase.IDLE
        assert (probed.probing.count, probed.probing.came) == (count, 2)
        assert probed.probing.touch == (float(count),) * 5


def test_a_touch_at_the_very_end_of_the_way_counts() -> None:
    probed = Probed()
    sensing = probed.begin()
    probed.probing.tell(sensing_of(ends=True))
    probed.tick(LATE_TICKS)
    probed.touch(sensing)
    probed.tick(LATE_TICKS)
    assert probed.probing.came == 1


@pytest.mark.parametrize("mode", [Mode.FAULT, Mode.READY, Mode.STOPPING])
def test_a_probing_is_given_up_with_its_program(mode: Mode) -> None:
    probed = Probed()
    probed.begin()
    probed.modes.mode = mode
    assert probed.tick() is Phase.IDLE and probed.probing.count == 0


def test_a_jog_leaves_it_as_it_is() -> None:
    probed = Probed()
    probed.begin()
    probed.modes.mode, probed.io.inputs = Mode.JOG, PROBE
    assert probed.tick() is Phase.ARMED
    probed.modes.mode = Mode.HOLD
    assert probed.tick() is Phase.TOUCHED


# ---- stored by the drives


def latched_touch(**stored: Any) -> Probed:
    probed = Probed(latched=True)
    sensing = probed.begin(latched=True)
    probed.tick(4)
    probed.touch(sensing)
    for name, value in stored.items():
        setattr(probed.latches[0], name, value)
    probed.tick(LATE_TICKS)
    return probed


def test_what_a_drive_has_stored_is_where_it_was() -> None:
    probed = latched_touch(touched=True, position=44_321)
    assert probed.probing.came == 1 and not probed.failed
    assert probed.probing.touch == (44.321, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("off", [0.0, MOVES_COUNTS])
def test_an_edge_just_where_the_last_one_was_is_not_told_again_and_counts(off: float) -> None:
    probed = Probed(latched=True)
    sensing = probed.begin(latched=True)
    probed.tick(4)
    probed.touch(sensing)
    seen = probed.group.positions[0]
    probed.latches[0].position = seen + off
    probed.tick(LATE_TICKS)
    assert probed.probing.touch[0] == pytest.approx((seen + off) / 1000.0)


def test_a_drive_that_moved_and_has_stored_nothing_is_named() -> None:
    probed = latched_touch()
    assert probed.failed == [(Fault.PROBE_LATCH, 0)]
    assert (probed.probing.phase, probed.probing.count, probed.follow.given_up) == (Phase.IDLE, 0, 0)


# ---- a touch in other motion


def test_a_probe_that_touches_in_other_motion_is_a_fault_where_the_motion_is_guarded() -> None:
    probed = Probed()
    probed.io.inputs = PROBE
    probed.tick()
    probed.follow.ahead = SimpleNamespace(guarded=False)
    probed.tick()
    assert not probed.failed
    probed.follow.ahead = SimpleNamespace(guarded=True)
    probed.tick()
    assert probed.failed == [(Fault.PROBE_HIT, -1)]
    probed.failed.clear()
    probed.io.inputs = 0
    probed.tick()
    assert not probed.failed


def test_the_way_off_the_part_may_be_as_long_as_the_way_behind_the_touch_and_the_release() -> None:
    probed = Probed()
    built = machine(latched=False)
    assert built.probe is not None
    probed.follow.joints = (0.0,) * 5
    probed.touch(probed.begin())
    probed.tick(LATE_TICKS, step=0)
    behind = probed.probing.touch[0]  # of the place of rest, which is 0
    probed.follow.ahead = SimpleNamespace(guarded=True)
    for way, fails in ((0.999, []), (1.001, [(Fault.PROBE_STUCK, -1)])):
        probed.follow.joints = (0.0, way * (behind + built.probe.release_mm), 0.0, 9.0, 9.0)
        probed.tick(step=0)
        assert probed.failed == fails
    probed.failed.clear()
    probed.io.inputs = 0  # free
    probed.tick(step=0)
    probed.io.inputs = PROBE
    probed.tick(step=0)
    assert probed.failed == [(Fault.PROBE_HIT, -1)]
