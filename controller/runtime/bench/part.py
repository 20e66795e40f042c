"""A part that a simulated machine can touch: solids and holes, walls of a program, each with its error.

    name = "block"
    frame = "G54"                     # seen from this work offset of the machine file, or "table"
    shift_mm = [0.2, -0.1, 0.05]      # where it really lies, and how it is turned: what a set-up has to find
    turned_deg = [0.0, 0.0, 0.3]

    [[solid]]                         # material: all of them together ...
    kind = "block"                    # block, plane, cylinder or sphere
    low_mm = [0.0, 0.0, -30.0]
    high_mm = [80.0, 50.0, 0.0]

    [[hole]]                          # ... less what is taken out of it: of the same kinds, reaching well
                                      # out of the material where it is open
    kind = "cylinder"
    ...

    [[wall]]                          # the surfaces of a program, a sheet with material on one side
    program = "wall.ngc"
    error_mm = 0.02                   # along the normal, out of the material
    waves_mm = 0.01                   # on top of it, ``waves`` times along the cut

Every shape is a signed distance, mm: above 0 outside of the material, and never more than the true distance,
so that whoever comes nearer by d need not look again before d is used up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.geometry.surfaces import Surface
from controller.geometry.vectors import Frame, Vector, X, Y, Z, add, dot, norm, rotate, scale, subtract, unit
from controller.machine.model import OFFSETS, Machine
from controller.machine.toml_table import ConfigError, Table, parse, read_text
from controller.plan.surfaces.cuts import surface_of
from controller.program import blocks
from controller.program.program import CutCone, CutNurbs, CutRuled, ProgramError, Side

Distance = Callable[[Vector], float]

KINDS = ("block", "plane", "cylinder", "sphere")
ALONG, ACROSS = 129, 9  # places of a wall from which its nearest point is looked for
NEWTON = 12
NEAR_MM = 1e-9


@dataclass(frozen=True, slots=True)
class Part:
    """A part where it lies: ``frame`` is seen from the table with all rotaries at zero."""

    name: str
    frame: Frame
    solids: tuple[Distance, ...]
    holes: tuple[Distance, ...]

    def distance(self, point: Vector) -> float:
        """From a point of the table frame to the material, mm; below 0 in it."""
        p = self.frame.from_parent(point)
        found = min(solid(p) for solid in self.solids)
        for hole in self.holes:
            found = max(found, -hole(p))
        return found

    def normal(self, point: Vector) -> Vector:
        """Out of the material, table frame: where the distance grows."""
        step = 1e-5
        return unit(
            tuple(  # type: ignore[arg-type]
                self.distance(add(point, scale(e, step))) - self.distance(subtract(point, scale(e, step)))
                for e in (X, Y, Z)
            )
        )


def read(top: Table, machine: Machine, folder: Path) -> Part:
    """The part of a simulation file. Raises ConfigError."""
    name = top.text("name", default="part")
    frame = _placed(top, machine)
    solids = [_shape(one) for one in top.tables("solid")]
    holes = [_shape(one) for one in top.tables("hole")]
    for one in top.tables("wall"):
        solids += _walls(one, machine, folder)
    if not solids:
        top.refuse("solid", "part_empty")
    return Part(name, frame, tuple(solids), tuple(holes))


def load(path: Path, machine: Machine) -> Part:
    """The part of a file of its own. Raises ConfigError."""
    top = parse(read_text(path), path.name)
    part = read(top, machine, path.parent)
    top.finish()
    return part


def _placed(top: Table, machine: Machine) -> Frame:
    names = [*OFFSETS[: len(machine.offsets)], "table"]
    chosen = top.text("frame", names, names[0])
    base = Frame() if chosen == "table" else machine.offsets[OFFSETS.index(chosen)]
    shift, turned = top.vector("shift_mm", (0.0, 0.0, 0.0)), top.vector("turned_deg", (0.0, 0.0, 0.0))
    axes = [X, Y, Z]
    for about, angle in zip((X, Y, Z), turned, strict=True):
        axes = [rotate(about, math.radians(angle), v) for v in axes]
    x, y, z = (base.turn(v) for v in axes)
    return Frame(base.to_parent(shift), x, y, z)


def _direction(table: Table, key: str) -> Vector:
    found = table.vector(key, Z)
    if norm(found) < NEAR_MM:
        table.refuse(key, "part_direction")
    return unit(found)


def _shape(table: Table) -> Distance:
    kind = table.text("kind", KINDS)
    found = {"block": _block, "plane": _plane, "cylinder": _cylinder, "sphere": _sphere}[kind](table)
    table.finish()
    return found


def _plane(table: Table) -> Distance:
    point, normal = table.vector("point_mm"), _direction(table, "normal")
    return lambda p: float(dot(subtract(p, point), normal))


def _sphere(table: Table) -> Distance:
    centre, radius = table.vector("centre_mm"), table.positive("radius_mm")
    return lambda p: float(norm(subtract(p, centre))) - radius


def _cylinder(table: Table) -> Distance:
    """``centre_mm`` is that of its end face, ``direction`` points out of it, ``height_mm`` goes down."""
    centre, direction = table.vector("centre_mm"), _direction(table, "direction")
    return cylinder(centre, direction, table.positive("radius_mm"), table.positive("height_mm"))


def cylinder(centre: Vector, direction: Vector, radius: float, height: float) -> Distance:
    """Of millimetres; see ``_cylinder``."""

    def distance(p: Vector) -> float:
        v = subtract(p, centre)
        up = float(dot(v, direction))
        out = float(norm(subtract(v, scale(direction, up)))) - radius
        return _inside_of(out, max(up, -height - up))

    return distance


def _block(table: Table) -> Distance:
    low, high = table.vector("low_mm"), table.vector("high_mm")
    if any(a >= b for a, b in zip(low, high, strict=True)):
        table.refuse("high_mm", "block_flat")

    def distance(p: Vector) -> float:
        offs = [max(a - q, q - b) for q, a, b in zip(p, low, high, strict=True)]
        beyond = math.sqrt(sum(d * d for d in offs if d > 0.0))
        return beyond if beyond > 0.0 else max(offs)

    return distance


def _inside_of(a: float, b: float) -> float:
    """Of what is inside of both, which stand at a right angle."""
    if a > 0.0 and b > 0.0:
        return math.hypot(a, b)
    return max(a, b)


# ---- walls -----------------------------------------------------------------------------------


def _walls(table: Table, machine: Machine, folder: Path) -> list[Distance]:
    path = folder / table.text("program")
    error, waves_mm = table.number("error_mm", default=0.0), table.number("waves_mm", default=0.0)
    waves = table.integer("waves", 1, 1000, 3)
    try:
        program = blocks.read(path.read_bytes(), machine, path.name)
    except (OSError, ProgramError) as wrong:
        table.refuse("program", "wall_unread", why=wrong)
    table.finish()
    cuts = [one for one in program.blocks if isinstance(one, CutCone | CutRuled | CutNurbs)]
    if not cuts:
        table.refuse("program", "wall_none")
    return [
        _wall(surface_of(c), c.modal.side, lambda u: error + waves_mm * math.sin(2.0 * math.pi * waves * u))
        for c in cuts
    ]


def _wall(surface: Surface, side: Side, error_mm: Callable[[float], float]) -> Distance:
    """The cutter runs on ``side`` of the travel: the material is on the other."""
    out = side.value
    u, v = np.meshgrid(np.linspace(0.0, 1.0, ALONG), np.linspace(0.0, 1.0, ACROSS), indexing="ij")
    grid = np.array(np.broadcast_arrays(*surface.point(u.ravel(), v.ravel(), np))).T

    def distance(p: Vector) -> float:
        seed = int(np.argmin(((grid - p) ** 2).sum(axis=1)))
        at_u, at_v = nearest(surface, p, divmod(seed, ACROSS))
        foot = surface.point(at_u, at_v)
        away = subtract(p, foot)
        normal = normal_at(surface, at_u, at_v)
        height = out * float(dot(away, normal))
        far = float(norm(away))
        beside = math.sqrt(max(far * far - height * height, 0.0))
        if beside > 1e-6:  # beyond its edges it is a sheet
            return far
        return height - error_mm(at_u)

    return distance


def normal_at(surface: Surface, u: float, v: float) -> Vector:
    """Unit normal dS/dv x dS/du of the surface at (u, v): right of the travel with C0 up."""
    lower, ruling = surface.lower.derivative(u, 1), surface.ruling_curve.derivative(u, 1)
    along = add(lower, scale(ruling, 1.0 - v))
    x, y, z = surface.ruling_curve.at(u)
    tx, ty, tz = along
    return unit((ty * z - tz * y, tz * x - tx * z, tx * y - ty * x))


def nearest(surface: Surface, point: Vector, seed: Sequence[int]) -> tuple[float, float]:
    """(u, v) of the place that is nearest to a point, from a place of the grid on; Gauss-Newton."""
    u, v = seed[0] / (ALONG - 1), seed[1] / (ACROSS - 1)
    for _ in range(NEWTON):
        ruling = surface.ruling_curve.at(u)
        su = add(surface.lower.derivative(u, 1), scale(surface.ruling_curve.derivative(u, 1), 1.0 - v))
        sv = scale(ruling, -1.0)
        off = subtract(point, surface.point(u, v))
        a, b, c = float(dot(su, su)), float(dot(su, sv)), float(dot(sv, sv))
        p, q = float(dot(su, off)), float(dot(sv, off))
        det = a * c - b * b
        if det <= 1e-300:
            break
        du, dv = (p * c - q * b) / det, (q * a - p * b) / det
        if not 0.0 <= u + du <= 1.0:  # along that edge
            du = min(max(u + du, 0.0), 1.0) - u
            dv = (q - b * du) / c
        if not 0.0 <= v + dv <= 1.0:
            dv = min(max(v + dv, 0.0), 1.0) - v
            du = min(max(u + (p - b * dv) / a, 0.0), 1.0) - u
        u, v = u + du, v + dv
        if abs(du) + abs(dv) < 1e-14:
            break
    return u, v


__all__ = ["ConfigError", "Part", "load", "nearest", "normal_at", "read"]
