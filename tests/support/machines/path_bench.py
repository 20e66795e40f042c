"""The queue and the clock of a path without a cycle around them: laws along X, messages, steps."""

from __future__ import annotations

from collections.abc import Sequence

from support.machines.shipped_kinds import machine

from controller.geometry.curves import Line
from controller.ipc.handoff import Law, Piece, PieceMessage, StopTable
from controller.machine.kinematics import kinematics_of
from controller.motion.motions import JointMove, Motion
from controller.tick.follow import Follow, Step

T = 0.002
SPEED = 40.0  # mm/s


def along_x(begin: float = 0.0, end: float = 1000.0) -> Motion:
    return JointMove(Line((begin, 0.0, 0.0), (end, 0.0, 0.0)), abs(end - begin), (0.0, 0.0), (0.0, 0.0))


def even(begin: float, seconds: float, speed: float = SPEED) -> Law:
    return Law((0.0, seconds), ((begin, speed, 0.0, 0.0, 0.0, 0.0),))


def braking(begin: float, seconds: float, speed: float = SPEED) -> Law:
    """From ``speed`` evenly down to rest."""
    return Law((0.0, seconds), ((begin, speed, -speed / seconds / 2.0, 0.0, 0.0, 0.0),))


def piece_of(law: Law, identity: int = 0, **more: object) -> Piece:
    return Piece(identity, 1, law, law.duration_s, **more)  # type: ignore[arg-type]


def plan(*seconds: float, identity: int = 0) -> list[Piece]:
    """One motion at an even speed, in pieces as long as these."""
    pieces, s = [], 0.0
    for each in seconds:
        pieces.append(piece_of(even(s, each), identity))
        s += SPEED * each
    return pieces


def follower() -> Follow:
    built = machine()
    return Follow(built, kinematics_of(built))


def message(
    follow: Follow,
    pieces: Sequence[Piece],
    motions: dict[int, Motion] | None = None,
    at_s: float | None = None,
    stops: Sequence[StopTable] = (),
) -> PieceMessage:
    start = follow.queue_end_s if at_s is None else at_s
    return PieceMessage(1, start, motions or {}, tuple(pieces), tuple(stops), follow.epoch)


def loaded(pieces: Sequence[Piece], stops: Sequence[StopTable] = ()) -> Follow:
    follow = follower()
    assert follow.accept(message(follow, pieces, {0: along_x()}, stops=stops))
    return follow


def steps(follow: Follow, count: int, go: bool = True) -> list[Step]:
    return [follow.step(go) for _ in range(count)]
