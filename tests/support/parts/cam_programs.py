"""Five-axis line programs as CAM systems write them: short segments, links, corners, noise."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

STEP_MM = 0.1


@dataclass(frozen=True, eq=False)
class Cloud:
    """The polyline of a program in the part frame, as its text will say it."""

    tips: np.ndarray  # (M, 3) mm
    axes: np.ndarray  # (M, 3) unit vectors
    lines: np.ndarray  # (M,) 1-based lines of the text, filled in by ``text``

    def __len__(self) -> int:
        return len(self.tips)

    def noisy(self, size_mm: float, seed: int = 0) -> Cloud:
        """Every point off by up to ``size_mm``, as after tessellation or rounding."""
        shift = np.random.default_rng(seed).uniform(-size_mm, size_mm, self.tips.shape)
        return replace(self, tips=self.tips + shift)

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.tips, axis=0), axis=1).sum())


def bowl(
    rows: int = 4,
    length_mm: float = 20.0,
    apart_mm: float = 1.0,
    step_mm: float = STEP_MM,
    tilt: float = 0.35,
    link: str = "arc",
) -> Cloud:
    """Rows to and fro over a gentle wave, the axis off its normal; linked by half circles or corners."""
    return over_the_wave(_even(_zigzag(rows, length_mm, apart_mm, link), step_mm), tilt)


def over_the_wave(xy: np.ndarray, tilt: float) -> Cloud:
    """Points (M, 2) lifted on to the wave, with axes."""
    x, y = xy.T
    z = 1.5 * np.sin(x / 7.0) + 1.0 * np.cos(y / 9.0)
    normal = np.stack([-1.5 / 7.0 * np.cos(x / 7.0), 1.0 / 9.0 * np.sin(y / 9.0), np.ones(len(x))], axis=1)
    axes = normal / np.linalg.norm(normal, axis=1)[:, None] + tilt * np.array([0.0, 1.0, 0.0])
    return _cloud(np.stack([x, y, z], axis=1), axes)


def wall(count: int = 400, step_mm: float = STEP_MM) -> Cloud:
    """Once round a leaning wall: the tip on a circle, the axis on a cone of 20 degrees; C makes a turn."""
    radius = count * step_mm / (2.0 * np.pi)
    at = np.linspace(0.0, 2.0 * np.pi, count + 1)
    out = np.stack([np.cos(at), np.sin(at), 0.0 * at], axis=1)
    return _cloud(
        radius * out, np.cos(np.radians(20.0)) * np.array([0.0, 0.0, 1.0]) + np.sin(np.radians(20.0)) * out
    )


def polygon(
    corners: Sequence[Sequence[float]], leans: Sequence[Sequence[float]], step_mm: float = STEP_MM
) -> Cloud:
    """Straight edges of short segments with real corners; the axis turns evenly along each edge."""
    tips, axes = [np.asarray(corners[0], float)], [np.asarray(leans[0], float)]
    for (a, b), (p, q) in zip(itertools.pairwise(corners), itertools.pairwise(leans), strict=True):
        a_, b_, p_, q_ = (np.asarray(v, float) for v in (a, b, p, q))
        count = max(1, round(float(np.linalg.norm(b_ - a_)) / step_mm))
        for share in np.linspace(0.0, 1.0, count + 1)[1:]:
            tips.append(a_ + share * (b_ - a_))
            axes.append(p_ + share * (q_ - p_))
    return _cloud(np.array(tips), np.array(axes))


def _cloud(tips: np.ndarray, axes: np.ndarray) -> Cloud:
    unit = axes / np.linalg.norm(axes, axis=1)[:, None]
    return Cloud(tips, unit, np.zeros(len(tips), dtype=int))


def _zigzag(rows: int, length: float, apart: float, link: str) -> np.ndarray:
    """A dense curve (N, 2): rows along x, half circles or straight steps between them."""
    made: list[np.ndarray] = []
    for k in range(rows):
        x = np.linspace(0.0, length, 400) - length / 2.0
        y = k * apart
        forth = k % 2 == 0
        made.append(np.stack([x if forth else -x, np.full(len(x), y)], axis=1))
        if k < rows - 1 and link == "arc":
            at = np.linspace(-np.pi / 2, np.pi / 2, 60)[1:-1]
            side = 1.0 if forth else -1.0
            middle = np.array([side * length / 2.0, y + apart / 2.0])
            made.append(middle + apart / 2.0 * np.stack([side * np.cos(at), np.sin(at)], axis=1))
    return np.concatenate(made)


def _even(curve: np.ndarray, step: float) -> np.ndarray:
    """Points ``step`` apart along a polyline; its last one too."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    at = np.append(np.arange(0.0, s[-1] - 0.3 * step, step), s[-1])
    return np.stack([np.interp(at, s, c) for c in curve.T], axis=1)


# --- the text


def trunnion_degrees(axes: np.ndarray) -> np.ndarray:
    """A and C (M, 2) of the shipped trunnion by Eq. 9 and 10, C without jumps."""
    tilt = np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2])
    return np.degrees(np.stack([tilt, np.unwrap(np.arctan2(axes[:, 0], axes[:, 1]))], axis=1))


def axes_of_trunnion(degrees: np.ndarray) -> np.ndarray:
    """Back again, (M, 3): what rounded rotary words really say."""
    a, c = np.radians(degrees).T
    return np.stack([np.sin(a) * np.sin(c), np.sin(a) * np.cos(c), np.cos(a)], axis=1)


def text(
    cloud: Cloud,
    feed: float = 3000.0,
    vectors: bool = False,
    path: str = "G64 P0.01",
    inverse_time: bool = False,
    decimals: int = 4,
) -> tuple[str, Cloud]:
    """(program, the polyline as rounded in it): G43.5 with I J K if ``vectors``, else G43.4 with A and C."""
    head = ["G21 G90 G54", path, "T2 M6", "S12000 M3", "G43.5" if vectors else "G43.4"]
    tips = np.round(cloud.tips, decimals)
    words = np.round(cloud.axes, 7) if vectors else np.round(trunnion_degrees(cloud.axes), decimals)
    axes = words / np.linalg.norm(words, axis=1)[:, None] if vectors else axes_of_trunnion(words)
    letters = "XYZIJK" if vectors else "XYZAC"
    rows = list(_rows(np.hstack([tips, words]), letters, decimals, feed, inverse_time))
    lines = np.arange(len(rows)) + len(head) + 1
    tail = ["G94" if inverse_time else "", "G49", "M5", "M30", ""]
    return "\n".join([*head, *rows, *tail]), Cloud(tips, axes, lines)


def _rows(values: np.ndarray, letters: str, decimals: int, feed: float, inverse_time: bool) -> Iterator[str]:
    gaps = np.linalg.norm(np.diff(values[:, :3], axis=0), axis=1)
    for n, row in enumerate(values):
        digits = [decimals] * 3 + ([7] * 3 if letters.endswith("K") else [decimals] * 2)
        said = " ".join(f"{a}{v:.{d}f}" for a, v, d in zip(letters, row, digits, strict=True))
        if n == 0:
            yield f"G0 {said}"
        elif inverse_time:
            yield ("G93 " if n == 1 else "") + f"G1 {said} F{feed / gaps[n - 1]:.4f}"
        else:
            yield f"G1 {said}" + (f" F{feed:g}" if n == 1 else "")
