"""Pictures of what was measured, as plain values that a protocol keeps; ``report`` draws them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.bringup.excitation import Excitation, Shown
from controller.bringup.response import AxisTicks, Bode
from controller.calibration.circular_test import Circle
from controller.geometry.arrays import Array
from controller.messages import Message, message

COLUMNS = 400  # of a picture; each keeps its lowest and its highest value
DIGITS = 6
ENLARGED = 0.3  # of the radius, that the largest deviation of a circle is drawn as


def _chart(
    title: Message, x: Message, y: Message, series: Sequence[dict[str, Any]], shape: str = ""
) -> dict[str, Any]:
    """``shape``: "log" of the lower scale, "circle": both scales alike."""
    return {"title": title, "x": x, "y": y, "series": list(series), "shape": shape}


def series(name: Message | str, x: Array, y: Array) -> dict[str, Any]:
    """A line with its name."""
    return {"name": name, "x": _plain(x), "y": _plain(y)}


def _plain(values: Array) -> list[float]:
    return [float(f"{value:.{DIGITS}g}") for value in values]


def _thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """At most two places a column, so that no peak is lost."""
    if len(x) <= 2 * COLUMNS:
        return x, y
    parts: list[NDArray[np.int64]] = np.array_split(np.arange(len(x)), COLUMNS)
    places = sorted({i for part in parts for i in (part[np.argmin(y[part])], part[np.argmax(y[part])])})
    return x[places], y[places]


def errors(axis: Shown, ticks: AxisTicks, made: Excitation) -> list[dict[str, Any]]:
    """Following error over the time, a picture a part."""
    found = []
    for part in made.parts:
        its = ticks.of_part(part)
        time_s: Array = its.period_s * np.arange(len(its.line), dtype=np.float64)
        title = message(f"bringup.chart.{part.kind}", axis=axis.name, percent=100.0 * made.share)
        line = series("", *_thinned(time_s, its.error))
        words = message("bringup.chart.seconds"), message("bringup.chart.error", unit=axis.words)
        found.append(_chart(title, *words, [line]))
    return found


def bode(axis: Shown, shares: Sequence[tuple[float, Bode]]) -> list[dict[str, Any]]:
    """Magnitude and phase over the frequency, a line a share of the speed."""
    hertz = message("bringup.chart.hertz")
    names = [message("bringup.chart.share", percent=100.0 * share) for share, _ in shares]
    gains = [
        series(name, one.frequency_hz, 20.0 * np.log10(one.magnitude))
        for name, (_, one) in zip(names, shares, strict=True)
    ]
    phases = [
        series(name, one.frequency_hz, one.phase_deg) for name, (_, one) in zip(names, shares, strict=True)
    ]
    return [
        _chart(
            message("bringup.chart.bode_gain", axis=axis.name),
            hertz,
            message("bringup.chart.gain"),
            gains,
            "log",
        ),
        _chart(
            message("bringup.chart.bode_phase", axis=axis.name),
            hertz,
            message("bringup.chart.phase"),
            phases,
            "log",
        ),
    ]


def standing(axis: Shown, actual: Array, period_s: float) -> dict[str, Any]:
    """Where an axis is while its drive is off, less where it was."""
    time_s: Array = period_s * np.arange(len(actual), dtype=np.float64)
    line = series("", *_thinned(time_s, actual - actual[0]))
    words = message("bringup.chart.seconds"), message("bringup.chart.moved", unit=axis.words)
    return _chart(message("bringup.chart.standing", axis=axis.name), *words, [line])


def circles(found: Sequence[Circle], names: tuple[str, str]) -> dict[str, Any]:
    """Radial deviations of the circles, enlarged, about the nominal one."""
    offs = [np.hypot(*one.path.T) - one.radius_mm for one in found]
    scale = ENLARGED / max(1e-6, *(float(np.abs(off).max()) for off in offs))
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    drawn = [series(message("bringup.chart.nominal"), np.cos(turn), np.sin(turn))]
    for one, off in zip(found, offs, strict=True):
        away = (1.0 + scale * off) / np.hypot(*one.path.T)
        place = (one.path * away[:, None])[:: max(1, len(off) // COLUMNS)]
        sense = "↺" if one.sense > 0 else "↻"
        drawn.append(series(f"{sense} {1e3 * off.min():.1f} … {1e3 * off.max():.1f} µm", *place.T))
    title = message("bringup.chart.circle", plane="".join(names), factor=round(scale * found[0].radius_mm))
    return _chart(title, message("text", text=names[0]), message("text", text=names[1]), drawn, "circle")
