"""Plots of what was measured: an axis by ISO 230-2, a circle by ISO 230-4, a tip that should stand."""

from __future__ import annotations

from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np

from controller.calibration.axis_accuracy import Runs
from controller.calibration.circular_test import Circle
from controller.calibration.five_axis_test import Stand

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73")  # Okabe and Ito's, as in ``verify.pictures``


def _figure() -> Figure:
    from matplotlib.figure import Figure  # slow to load, and most commands draw nothing

    return Figure(figsize=(9.0, 6.0), dpi=110, facecolor="white", layout="constrained")


def axis(runs: Runs, name: str, unit: str, path: Path | IO[bytes]) -> None:
    """Means with two standard deviations about them, in both senses, over the targets."""
    figure = _figure()
    axes = figure.add_subplot(xlabel=f"{name} ({unit})", ylabel="µm" if unit == "mm" else "0.001°")
    for values, mark, colour in ((runs.up, "↑", COLOURS[0]), (runs.down, "↓", COLOURS[1])):
        if values is None:
            continue
        mean = 1e3 * values.mean(axis=1)
        axes.plot(runs.at, mean, "o-", color=colour, label=mark)
        if values.shape[1] > 1:
            s = 2e3 * values.std(axis=1, ddof=1)
            axes.fill_between(runs.at, mean - s, mean + s, color=colour, alpha=0.2)
    axes.axhline(0.0, color="#6E6E6E", linewidth=0.8)
    axes.legend()
    figure.savefig(path, format="png")


def circle(found: list[Circle], names: tuple[str, str], path: Path | IO[bytes]) -> None:
    """Radial deviations of the last circle of each sense, enlarged, about the nominal circle."""
    figure = _figure()
    axes = figure.add_subplot(xlabel=names[0], ylabel=names[1], aspect="equal")
    last = {one.sense: one for one in found}
    offs = {sense: np.hypot(*one.path.T) - one.radius_mm for sense, one in last.items()}
    scale = 0.3 / max(1e-6, *(float(np.abs(off).max()) for off in offs.values()))
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(np.cos(turn), np.sin(turn), color="#6E6E6E", linewidth=0.8)
    for (sense, one), colour in zip(last.items(), COLOURS, strict=False):
        away = (1.0 + scale * offs[sense]) / np.hypot(*one.path.T)
        label = (
            f"{'↺' if sense > 0 else '↻'} {1e3 * offs[sense].min():.2f} … {1e3 * offs[sense].max():.2f} µm"
        )
        axes.plot(*(one.path * away[:, None]).T, color=colour, linewidth=1.0, label=label)
    axes.set_title(f"R {next(iter(last.values())).radius_mm:.3f} mm")
    axes.legend(loc="center")
    figure.savefig(path, format="png")


def tip(found: list[Stand], path: Path | IO[bytes]) -> None:
    """Where the tip was less where it should stand, one below the other by line."""
    figure = _figure()
    panels = figure.subplots(len(found), 1, squeeze=False)[:, 0]
    for one, axes in zip(found, panels, strict=True):
        for k, name in enumerate("XYZ"):
            axes.plot(1e3 * one.off[:, k], color=COLOURS[k], label=name, linewidth=1.0)
        axes.set_ylabel(f"N {one.line} (µm)")
    panels[0].legend(ncols=3)
    figure.savefig(path, format="png")
