"""The planner keeps the queue full, chain by chain, and never says half a thing."""

from __future__ import annotations

import math

import pytest
import traced
from cutting import program, shipped

from controller.handoff import PieceMessage, Snapshot
from controller.kinematics import Kinematics
from controller.machine import Machine
from controller.plan.path import Chain, Path
from controller.plan.planner import AHEAD_S, Planner
from controller.state import Fault, Mode

MOVES = "G0 X100.\nG1 F600. X120.\nX120. Y30.\nG4 P1.5\nM0\nG1 X0. Y0.\nM30\n"


def now(plan_time_s: float, override: float = 1.0, rapid_override: float = 1.0) -> Snapshot:
    five = (0.0,) * 5
    fields = dict.fromkeys(Snapshot._fields, 0) | {
        "mode": Mode.RUNNING,
        "fault": Fault.NONE,
        "plan_time_s": plan_time_s,
        "override": override,
        "rapid_override": rapid_override,
        "joints": five,
        "actual": five,
        "drive_states": (0,) * 5,
    }
    return Snapshot(**fields)


class Desk:
    """A planner whose messages land on a list."""

    def __init__(self, source: str, machine: Machine | None = None) -> None:
        self.machine = machine or shipped(spindle=None)
        self.sent: list[PieceMessage] = []
        self.planner = Planner(self.machine, Kinematics(self.machine), self._send)
        home = tuple(axis.homing.position for axis in self.machine.axes)
        self.path: Path = traced.trace(source, self.machine, home)  # type: ignore[arg-type]
        self.planner.load(self.path, 7.0)

    def _send(self, message: PieceMessage) -> bool:
        self.sent.append(message)
        return True

    def all(self) -> list[PieceMessage]:
        for _ in range(10 * len(self.path.items) + 10):
            self.planner.work(now(self.end_s))
        return self.sent

    @property
    def end_s(self) -> float:
        last = self.sent[-1] if self.sent else None
        return 7.0 if last is None else last.replace_from_s + sum(p.duration_s for p in last.pieces)


def test_each_message_is_one_item_of_the_path_and_goes_on_where_the_last_one_ended() -> None:
    desk = Desk(MOVES)
    sent = desk.all()
    assert len(sent) == len(desk.path.items)
    assert [m.sequence for m in sent] == list(range(1, len(sent) + 1))
    end_s = 7.0
    for message in sent:
        assert message.replace_from_s == pytest.approx(end_s, abs=1e-12)
        end_s += sum(piece.duration_s for piece in message.pieces)
    assert desk.planner.finished and desk.planner.finished_path


def test_every_message_ends_at_rest_and_brings_the_motions_it_names() -> None:
    for message in Desk(program("example2_ready.ngc", "3000."), shipped()).all():
        last = [piece for piece in message.pieces if piece.motion_id >= 0]
        if last:
            speed = last[-1].law.at(last[-1].law.duration_s)[1]
            assert abs(speed) < 1e-6
            assert last[0].law.at(0.0)[1] == 0.0
        assert {piece.motion_id for piece in message.pieces} - {-1} == set(message.motions)


def test_only_the_last_piece_of_the_program_ends_it_and_a_stop_stops() -> None:
    sent = Desk(MOVES).all()
    ends = [piece.end for message in sent for piece in message.pieces]
    assert ends[-1] and not any(ends[:-1])
    assert [piece.stop for message in sent for piece in message.pieces].count(True) == 1


def test_a_dwell_lasts_as_the_program_says() -> None:
    durations = [p.duration_s for m in Desk(MOVES).all() for p in m.pieces if p.motion_id == -1]
    assert 1.5 in durations


def test_a_full_queue_gets_no_more_and_a_call_sends_one_item_at_most() -> None:
    desk = Desk(MOVES)
    before = 0
    for _ in range(20):
        desk.planner.work(now(7.0))
        assert len(desk.sent) - before <= 1
        before = len(desk.sent)
    held = desk.end_s - sum(piece.duration_s for piece in desk.sent[-1].pieces) - 7.0
    assert held < AHEAD_S or desk.planner.finished


def test_what_is_planned_does_not_depend_on_when_the_planner_is_asked() -> None:
    early, late = Desk(MOVES), Desk(MOVES)
    for _ in range(40):
        late.planner.work(now(late.end_s - AHEAD_S + 1e-3))
    assert [m.pieces for m in early.all()] == [m.pieces for m in late.sent]


def test_a_keepalive_carries_nothing_and_counts_on() -> None:
    desk = Desk(MOVES)
    desk.planner.work(now(7.0))
    desk.planner.keepalive()
    assert desk.sent[-1].is_keepalive
    assert desk.sent[-1].sequence == desk.sent[-2].sequence + 1


def test_after_a_drop_nothing_more_is_sent_and_the_path_is_not_called_finished() -> None:
    desk = Desk(MOVES)
    desk.planner.work(now(7.0))
    desk.planner.drop()
    desk.planner.work(now(1e9))
    assert len(desk.sent) == 1
    assert desk.planner.finished and not desk.planner.finished_path


def test_a_new_path_after_a_drop_starts_at_the_queue_it_is_given() -> None:
    desk = Desk(MOVES)
    desk.planner.drop()
    desk.planner.load(desk.path, 3.25)
    desk.planner.work(now(3.25))
    assert desk.sent[0].replace_from_s == 3.25
    assert not desk.planner.finished_path


@pytest.mark.parametrize("override", [0.5, 1.5])
def test_feeds_are_planned_at_the_override_where_it_is_more_than_programmed_and_rapids_never_are(
    override: float,
) -> None:
    desk = Desk("G0 X100.\nG1 F600. X200.\nM30\n")
    for _ in range(8):
        desk.planner.work(now(desk.end_s, override))
    rapid, feed = (p for m in desk.sent for p in m.pieces if p.motion_id >= 0)
    assert rapid.override == 1.0 and rapid.rapid
    planned = max(override, 1.0)  # what is less, the tick's clock does at once
    assert feed.override == planned
    assert feed.law.at(feed.duration_s / 2)[1] == pytest.approx(10.0 * planned)


def test_motion_names_are_never_used_twice_and_are_kept_for_traces() -> None:
    desk = Desk(MOVES)
    desk.all()
    names = [name for message in desk.sent for name in message.motions]
    moves = sum(len(item.stretches) for item in desk.path.items if isinstance(item, Chain))
    assert len(names) == len(set(names)) == moves == len(desk.planner.stretches)


@pytest.mark.parametrize("override", [0.0, 1e-6])
def test_an_override_of_next_to_nothing_still_makes_finite_laws(override: float) -> None:
    """An operator may turn the override to 0 while chains are still to be planned."""
    desk = Desk("G1 F600. X20.\nM30\n")
    desk.planner.work(now(7.0, override))
    assert all(math.isfinite(p.duration_s) and p.duration_s >= 0.0 for m in desk.sent for p in m.pieces)
