"""Cutters drawn point by point: what the profile of a tool is held against."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from controller.machine.model import Tool


def turned(rho: float, h: float, radius: float, low: float, high: float) -> np.ndarray:
    """Points of an arc."""
    turn = np.linspace(low, high, 801)
    return np.stack([rho + radius * np.cos(turn), h + radius * np.sin(turn)], axis=1)


def border(tool: Tool) -> np.ndarray:
    """Points of a cutter's border in the half plane, upwards from the axis and back to it.

    They are drawn as a workshop would: the corner is rolled into end and flank, a barrel is tried until it
    touches the corner and ends at the flute's end with its middle at the taper.
    """
    r, c, t, down = tool.radius_mm, tool.corner_mm, tool.taper_rad, -0.5 * math.pi
    h, low, tip = c, down, np.array([[0.0, 0.0]])
    if tool.end_mm is not None:
        h = tool.end_mm - math.sqrt((tool.end_mm - c) ** 2 - (r - c) ** 2)
        low = math.atan2(h - tool.end_mm, r - c)
        tip = turned(0.0, tool.end_mm, tool.end_mm, down, low)
    elif tool.point_rad < math.pi:
        lean = 0.5 * tool.point_rad
        low, h = -lean, ((r - c) + c * math.cos(lean)) / math.tan(lean) + c * math.sin(lean)
    parts = [tip]
    if tool.barrel_mm is not None:
        far = tool.barrel_mm

        def centre(b: float) -> tuple[float, float]:
            return r - c - (far - c) * math.cos(t + b), h + (far - c) * math.sin(t + b)

        b = brentq(lambda b: centre(b)[1] + far * math.sin(b - t) - tool.flute_mm, 0.0, 0.5)
        parts += [turned(r - c, h, c, low, -t - b), turned(*centre(b), far, -t - b, b - t)]
    else:
        parts.append(turned(r - c, h, c, low, -t))
        if tool.back_mm:
            high = max(h, tool.flute_mm - tool.back_mm)
            parts.append(turned(r - tool.back_mm, high, tool.back_mm, 0.0, 0.5 * math.pi))
        else:
            rho, at = parts[-1][-1]
            parts.append(np.array([[rho + (tool.flute_mm - at) * math.tan(t), tool.flute_mm]]))
    drawn = np.vstack(parts)
    (before, last), k = drawn[-2:], int(np.argmax(drawn[:, 1] >= tool.flute_mm - 1e-12))
    if k:  # the flute's end cuts it off
        before, last = drawn[k - 1 : k + 1]
        share = (tool.flute_mm - before[1]) / max(last[1] - before[1], 1e-15)
        drawn = np.vstack([drawn[:k], before + share * (last - before)])
    return np.vstack([drawn, [[0.0, drawn[-1, 1]]]])
