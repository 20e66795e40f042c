"""The pictures of a measurement, as SVG: how many woke how late, and the worst of each turn over the time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from controller.cli.host_measure import Turn
from controller.runtime.wake_ups import BINS, Histogram
from controller.verify.chart import HEIGHT, WIDTH, svg, text
from controller.verify.console import say

LEFT, RIGHT, TOP, BOTTOM = 60, 16, 14, 44  # margins
PER_DECADE = 16  # classes of the histogram
BEYOND_US = 2 * BINS  # where the class of what is beyond ends
COLOURS = ("#0b5cad", "#b3470b", "#2c7a2c", "#7b3aa5", "#8a6d00", "#00727a")
DASHES = ("", "6 3", "2 3", "8 3 2 3", "1 2", "10 4")
GREY = "#bbb"


@dataclass(frozen=True, slots=True)
class Axes:
    """Places in the picture (px). Upwards is logarithmic from 10^low to 10^high; to the right, too, if so."""

    left: float
    right: float
    low: float
    high: float
    is_log: bool

    def x(self, value: float) -> float:
        first, last, at = self.left, self.right, value
        if self.is_log:
            first, last, at = (math.log10(max(one, self.left)) for one in (first, last, value))
        share = (at - first) / (last - first or 1.0)
        return LEFT + (WIDTH - LEFT - RIGHT) * min(max(share, 0.0), 1.0)

    def y(self, value: float) -> float:
        share = (math.log10(value) - self.low) / (self.high - self.low) if value > 0.0 else 0.0
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * min(max(share, 0.0), 1.0)


def histogram(names: Sequence[str], counts: Sequence[Histogram], limit_s: float) -> str:
    """How many took how long; the limit is a line."""
    most = max(one.count for one in counts)
    axes = Axes(1.0, BEYOND_US, -0.5, max(math.ceil(math.log10(most + 1)), 1), is_log=True)
    parts = [*_decades(axes), *(_x_mark(axes, 10.0**n, f"{10**n}") for n in range(5))]
    at = axes.x(1e6 * limit_s)
    parts += [_limit(at, at, TOP, HEIGHT - BOTTOM), text(at - 6, TOP + 14, _say("limit"), "end")]
    for n, (name, one) in enumerate(zip(names, counts, strict=True)):
        classes = [(low, min(high, BEYOND_US), count) for low, high, count in one.classes(PER_DECADE)]
        points = [(axes.x(at), axes.y(count)) for low, high, count in classes for at in (low, high)]
        parts += _curve(n, name, points)
    parts.append(_words_below(_say("time")))
    return svg(_say("histogram"), parts)


def course(turns: Sequence[Turn], limit_s: float) -> str:
    """The worst of each turn over the time (min), with the limit as a line."""
    worst = [1e6 * one.worst_s for one in turns]
    high = math.ceil(math.log10(max(*worst, 1e6 * limit_s, 10.0)))
    axes = Axes(0.0, turns[-1].ended_s / 60.0, 0.0, high, is_log=False)
    step = 10.0 ** math.floor(math.log10(axes.right or 1.0))
    marks = [step * n for n in range(math.floor(axes.right / step) + 1)]
    parts = [*_decades(axes), *(_x_mark(axes, one, f"{one:g}") for one in marks)]
    at = axes.y(1e6 * limit_s)
    parts += [_limit(LEFT, WIDTH - RIGHT, at, at), text(LEFT + 6, at - 5, _say("limit"), "start")]
    points = [(axes.x(one.ended_s / 60.0), axes.y(us)) for one, us in zip(turns, worst, strict=True)]
    parts += _curve(0, _say("worst"), points)
    parts.append(_words_below(_say("minutes")))
    return svg(_say("course"), parts)


def _curve(number: int, name: str, points: Sequence[tuple[float, float]]) -> Iterator[str]:
    """A line with its name; told apart by its dashes, too."""
    colour, dash = COLOURS[number % len(COLOURS)], DASHES[number % len(DASHES)]
    pen = f'stroke="{colour}" stroke-width="1.7" stroke-dasharray="{dash}"'
    places = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    yield f'<polyline fill="none" {pen} points="{places}"/>\n'
    at = TOP + 10 + 17 * number
    yield f'<line x1="{WIDTH - 250}" y1="{at}" x2="{WIDTH - 215}" y2="{at}" {pen}/>'
    yield text(WIDTH - 208, at + 4, name, "start")


def _decades(axes: Axes) -> Iterator[str]:
    for n in range(math.ceil(axes.low), math.floor(axes.high) + 1):
        at = axes.y(10.0**n)
        yield f'<line x1="{LEFT}" y1="{at:.1f}" x2="{WIDTH - RIGHT}" y2="{at:.1f}" stroke="{GREY}"/>'
        yield text(LEFT - 6, at + 4, f"{10**n}", "end")


def _x_mark(axes: Axes, value: float, label: str) -> str:
    at, foot = axes.x(value), HEIGHT - BOTTOM
    line = f'<line x1="{at:.1f}" y1="{foot}" x2="{at:.1f}" y2="{foot + 5}" stroke="#111"/>'
    return line + text(at, foot + 18, label, "middle")


def _limit(x1: float, x2: float, y1: float, y2: float) -> str:
    place = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    return f'<line class="limit" {place} stroke="#c00" stroke-width="1.2"/>'


def _words_below(words: str) -> str:
    return text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 8, words, "middle")


def _say(key: str) -> str:
    return say(f"host.picture.{key}")
