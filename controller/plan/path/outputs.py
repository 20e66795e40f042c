"""What the program says of outputs (M62, M63), overrides (M48 to M53) and optional stops (M1) while it moves.

Each segment has what was said up to its block. An M1 between two lines or arcs is a mark on the first of
them, so that it costs nothing where it is switched off. Any other is a pause: the machine stands there
anyway, is to leave a surface before somebody looks at it, or to close its clamps.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace

from controller.machine.model import Machine
from controller.messages import message
from controller.motion.motions import ThreadMove
from controller.plan.context import Context
from controller.plan.lines.corners import Feed
from controller.plan.segment import ContinuousPath, PathItem, Segment
from controller.program.program import (
    ENABLED,
    UNSAID,
    Act,
    Action,
    Block,
    Modal,
    Outputs,
    Overrides,
    Probing,
    probing_of,
)

_Said = tuple[Outputs, Overrides, bool]
_NOTHING: _Said = (UNSAID, ENABLED, False)


class Switched:
    """Notes the blocks as they are read, and hands on what is made of them."""

    def __init__(self, machine: Machine) -> None:
        self._has_clamps = any(axis.clamp is not None for axis in machine.axes)
        self._stops = frozenset[int]()  # orders of blocks that end with an M1
        self._probe = machine.probe.tool if machine.probe is not None else None
        self._said = deque[tuple[int, _Said]]([(0, _NOTHING)])  # from which order on

    def read(self, blocks: Iterable[Block]) -> Iterator[Block]:
        before: Modal | None = None
        for block in blocks if self._has_clamps else self._marked(blocks):
            if (modal := block.modal) is not before:  # many lines share one
                before, said = modal, (modal.outputs, modal.overrides, modal.tool == self._probe)
                if said != self._said[-1][1]:
                    self._said.append((block.place.order, said))
            yield block

    def _marked(self, blocks: Iterable[Block]) -> Iterator[Block]:
        """All but each M1 between two lines or arcs with a feed, of which the first is remembered."""
        before: Block | None = None
        waiting: list[Block] = []  # an M1 after ``before``
        for block in blocks:
            if waiting:
                assert before is not None
                if _feeds(block):
                    self._stops |= {before.place.order}
                else:
                    yield from waiting
                waiting.clear()
            elif isinstance(block, Action) and block.act is Act.OPTIONAL_STOP and _feeds(before):
                waiting.append(block)
                continue
            before = block
            yield block
        yield from waiting

    def laid(self, items: Iterable[PathItem]) -> Iterator[PathItem]:
        """The same path; the segments come in the order of their blocks."""
        for item in items:
            if isinstance(item, ContinuousPath) and self._stops:
                item = replace(item, optional_stops=self._stops)
                self._stops = frozenset(one for one in self._stops if one >= item.place.order)
            if isinstance(item, ContinuousPath) and (
                len(self._said) > 1 or self._said[0][1] != _NOTHING or _tied(item)
            ):
                item = replace(item, segments=tuple(self._switching(one) for one in item.segments))
            yield item

    def _switching(self, segment: Segment) -> Segment:
        while len(self._said) > 1 and self._said[1][0] <= segment.place.order:
            self._said.popleft()
        outputs, overrides, guarded = self._said[0][1]
        if segment.name == PROBE:
            overrides, guarded = overrides._replace(feed=False), False
        if isinstance(segment.motion, ThreadMove):  # its feed is the spindle's
            overrides = overrides._replace(feed=False)
        return replace(segment, outputs=outputs, overrides=overrides, guarded=guarded)


def _feeds(block: Block | None) -> bool:
    return isinstance(block, Feed) and block.feed_mm_s is not None and probing_of(block) is None


def _tied(chain: ContinuousPath) -> bool:
    return any(isinstance(segment.motion, ThreadMove) for segment in chain.segments)


# The way of a probing move: not faster than the probe can bear when it is stopped behind a touch.
#
# touch --- seen, the stop begins, setpoint sent --- the axes lag behind it --- stopped by their jerk

PROBE = "probe"
SEEN_TICKS = 5  # from the edge to the first setpoint that is slower, at the most
CLOSE = 1e-4  # of the fastest feed that is told, mm/s


def probing_way(chain: ContinuousPath, probe: Probing, tool: int, context: Context) -> ContinuousPath:
    """The same way, under its own feed alone; refused where its stop would be too long for the probe."""
    sensor = context.machine.sensor(tool)
    most_mm = sensor.overtravel_mm if sensor is not None else 0.0
    late_s = SEEN_TICKS * context.machine.period_s + (sensor.latency_s if sensor is not None else 0.0)
    for segment in chain.segments:
        feed = segment.feed_mm_s or 0.0
        found = overtravel_mm(segment, feed, late_s, context.machine)
        if found > most_mm:
            fastest = math.floor(60.0 * _fastest(segment, most_mm, late_s, context.machine))
            context.refuse(
                segment.place,
                message(
                    "probing.too_fast",
                    code=probe.code,
                    feed=60.0 * feed,
                    found=found,
                    most=most_mm,
                    fastest=fastest,
                ),
            )
    mine = [replace(one, name=PROBE, overrides=one.overrides._replace(feed=False)) for one in chain.segments]
    return replace(chain, segments=tuple(mine))


def overtravel_mm(segment: Segment, feed_mm_s: float, late_s: float, machine: Machine) -> float:
    """How far the axes go on behind a touch, at the most: seen, lagging, stopped within their limits."""
    ways = [(segment.end[i] - segment.start[i], machine.axes[i]) for i in machine.linear()]
    length = math.sqrt(sum(way * way for way, _ in ways))
    if length == 0.0:
        return 0.0
    shares = [(abs(way) / length, axis) for way, axis in ways if way]
    lag_s = max(axis.following.at_speed / axis.limits.velocity for _, axis in shares)
    a = min(axis.limits.acceleration / share for share, axis in shares)
    j = min(axis.limits.jerk / share for share, axis in shares)
    stop_s = 2.0 * math.sqrt(feed_mm_s / j) if feed_mm_s * j <= a * a else feed_mm_s / a + a / j
    return feed_mm_s * (late_s + lag_s + 0.5 * stop_s)


def _fastest(segment: Segment, most_mm: float, late_s: float, machine: Machine) -> float:
    low, high = 0.0, segment.feed_mm_s or 0.0
    while high - low > CLOSE:
        middle = 0.5 * (low + high)
        inside = overtravel_mm(segment, middle, late_s, machine) <= most_mm
        low, high = (middle, high) if inside else (low, middle)
    return low
