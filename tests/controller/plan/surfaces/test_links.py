"""Links between two surfaces: joined to both in place, rate and bend, off both, and where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.machines.shipped_kinds import machine as of_kind
from support.machines.stepped_runs import Cut, cut, shipped
from support.machines.traced_programs import HOME, assert_goes_on, assert_whole, mill, named, names, trace
from support.oracles.trace_limits import assert_in_limits
from support.parts.random_surfaces import Pair, compound

from controller.machine import machine_file
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.plan.path import path
from controller.plan.segment import ContinuousPath
from controller.program import blocks
from controller.program.program import ProgramError

LINK_MM = 12.0


def surface(x0: float, y0: float, x1: float, y1: float, lean: float = 0.5, words: str = "") -> str:
    """A plane wall 10 mm high that leans by ``lean`` mm to its left."""
    way = np.array([x1 - x0, y1 - y0])
    left = lean * np.array([-way[1], way[0]]) / np.linalg.norm(way)
    points = [np.array([x0, y0]) + k / 3 * way for k in range(4)]
    upper = [f"X{x:.6f} Y{y:.6f} Z10." for x, y in (p + left for p in points)]
    lower = [f"X{x:.6f} Y{y:.6f} Z0." for x, y in points]
    first, *others = [*upper, *lower]
    return "\n".join([f"{words}\nG52 {first} F600.", *others, ""])


def linking(built: Machine | None = None) -> Machine:
    return replace(built or mill(), link_mm=LINK_MM)


def runs(text: str, built: Machine | None = None) -> list[list[str]]:
    return [chain for chain in names(trace("G42\n" + text, built or linking())) if "cut" in chain]


ROW = surface(0.0, 0.0, 20.0, 0.0) + surface(25.0, 0.0, 45.0, 2.0)
LINKED = [["lead in", "cut", "link", "cut", "lead out"]]
APART = [["lead in", "cut", "lead out"]] * 2


def test_two_surfaces_near_each_other_are_cut_in_one_run() -> None:
    assert runs(ROW) == LINKED
    assert runs(ROW + surface(49.0, 3.0, 60.0, 3.0)) == [
        ["lead in", "cut", "link", "cut", "link", "cut", "lead out"]
    ]


@pytest.mark.parametrize(
    "text",
    [
        surface(0.0, 0.0, 20.0, 0.0) + surface(32.5, 0.0, 45.0, 0.0),
        "G61\n" + ROW,
        surface(0.0, 0.0, 20.0, 0.0) + surface(25.0, 0.0, 45.0, 2.0, words="T2 M6"),
        surface(0.0, 0.0, 20.0, 0.0) + surface(25.0, 0.0, 45.0, 2.0, words="G41"),
        surface(0.0, 0.0, 20.0, 0.0) + surface(20.0, 5.0, 0.0, 5.0),
    ],
    ids=["too far", "G61", "another tool", "another side", "a half turn"],
)
def test_where_more_changes_than_the_place_the_tool_goes_up(text: str) -> None:
    assert runs(text) == APART


def test_without_the_key_the_tool_goes_up() -> None:
    assert mill().link_mm == 0.0
    assert runs(ROW, mill()) == APART


def test_a_link_that_would_cut_into_a_wall_between_is_none() -> None:
    """The second surface stands across the way to it: its own flank is in the way of what leads there."""
    text = surface(0.0, 0.0, 20.0, 0.0, 0.0) + surface(22.0, -1.0, 22.0, 9.0, 0.0)
    assert runs(text) == APART


@pytest.mark.parametrize("kind", ["fig4a", "fig4b", "table_head", "head_head", "oblique"])
def test_a_link_goes_on_as_the_cuts_beside_it(kind: str) -> None:
    built = linking(of_kind(kind))
    traced = trace("G42\n" + surface(0.0, 0.0, 20.0, 1.0) + surface(25.0, 2.0, 45.0, 5.0, 1.0), built)
    (link,), (before, after) = named(traced, "link"), named(traced, "cut")
    for one, other in ((before, link), (link, after)):
        assert_goes_on(one, other, built)
    assert_whole(traced, built)


def test_what_is_sound_before_a_corner_that_is_refused_is_cut_all_the_same() -> None:
    built = linking()
    walls = [(0.0, 0.0, 20.0, 0.0), (25.0, 0.0, 45.0, 2.0), (45.0, 2.0, 50.0, -20.0)]
    program = "G42\n" + "".join(surface(*wall, 0.0) for wall in walls)
    read = blocks.read(program.encode(), built, "part.ngc").blocks
    made = []
    with pytest.raises(ProgramError, match="concave corner"):
        for item in path.stream(read, "part.ngc", built, kinematics_of(built), HOME):
            made += [segment.name for segment in item.segments] if isinstance(item, ContinuousPath) else []
    assert "cut" in made and made[-1] == "retract"


# --- seen from the ticks


def moved(pair: Pair, by: np.ndarray) -> Pair:
    return pair[0] + by, pair[1] + by


def text(pairs: list[Pair], feed: float) -> str:
    lines = ["G21 G90 G54", "T2 M6", "S12000 M3", "G42 R0.5"]
    for upper, lower in pairs:
        words = [" ".join(f"{c}{q:.9f}" for c, q in zip("XYZ", p, strict=True)) for p in (*upper, *lower)]
        lines += [f"G52 {words[0]} F{feed}", *words[1:]]
    return "\n".join([*lines, "G40", "M5", "M30", ""])


def points(pair: Pair) -> np.ndarray:
    """(N, 3) of a ruled surface, by de Casteljau."""
    found = []
    for u in np.linspace(0.0, 1.0, 241):
        rows = []
        for curve in pair:
            p = curve
            while len(p) > 1:
                p = p[:-1] + u * np.diff(p, axis=0)
            rows.append(p[0])
        found += [rows[1] + v * (rows[0] - rows[1]) for v in np.linspace(0.0, 1.0, 15)]
    return np.array(found)


def depth(at: np.ndarray, tips: np.ndarray, axes: np.ndarray, radius: float) -> float:
    """How deep (mm) a cylinder of ``radius`` gets into the points, at most over all poses."""
    worst = 0.0
    for tip, axis in zip(tips, axes, strict=True):
        along = (at - tip) @ axis
        off = np.linalg.norm(at - tip - along[:, None] * axis, axis=1)
        worst = max(worst, float((radius - off[along > 0.0]).max(initial=0.0)))
    return worst


def ends_of_cuts(done: Cut) -> tuple[float, float]:
    """Speed of the contact (mm/s) in the last tick of the first cut and the first one of the second."""
    first, second = (
        done.column("feed_mm_s")[done.column("motion_id") == i] for i, s in done.segments.items() if s.cutting
    )
    return float(first[-1]), float(second[0])


@pytest.mark.parametrize("seed", [3, *(pytest.param(k, marks=pytest.mark.slow) for k in range(20, 40))])
def test_random_surfaces_one_behind_the_other(seed: int) -> None:
    """The contact goes from one to the other as fast as with leads, and the cutter reaches into neither."""
    rng = np.random.default_rng(seed)
    first, second = compound(seed, 2)
    way = first[1][3] - first[1][2]
    by = rng.uniform(2.0, 7.0) * way / np.linalg.norm(way) + rng.uniform(-0.5, 0.5, 3) * (1.0, 1.0, 0.0)
    pairs = [first, moved(second, by)]
    done, led = (cut(text(pairs, 600.0), shipped(link_mm=most, period_s=0.004)) for most in (LINK_MM, 0.0))
    assert done.run.result == "completed"
    assert_in_limits(done, seed)
    link = [i for i, segment in done.segments.items() if segment.name == "link"]
    if not link:
        return
    ends = [ends_of_cuts(one) for one in (done, led)]
    assert ends[0][0] >= 0.99 * ends[1][0] and ends[0][1] >= 0.99 * ends[1][1]
    rows = {i: np.flatnonzero(done.column("motion_id") == i) for i in (link[0] - 1, link[0], link[0] + 1)}
    segment = done.segments[link[0]]
    part, radius = done.machine.offsets[0], done.machine.tool(2).radius_mm  # type: ignore[union-attr]

    def reached(ticks: np.ndarray, pair: Pair) -> float:
        poses = done.kinematics.forward(tuple(done.joints[ticks].T), segment.motion.length_mm, np)  # type: ignore[union-attr]
        tips, axes = np.array(part.from_parent(poses.tip)).T, np.array(part.turn_back(poses.axis)).T
        return depth(points(pair), tips, np.broadcast_to(axes, tips.shape), radius)

    on_the_way = rows[link[0]]
    for i, nearest, pair in ((-1, on_the_way[:1], pairs[0]), (1, on_the_way[-1:], pairs[1])):
        cutting = reached(np.concatenate((rows[link[0] + i], nearest)), pair)
        assert reached(on_the_way, pair) <= 1.1 * cutting + 2e-4


def test_most_random_surfaces_near_each_other_are_linked() -> None:
    built, found = replace(shipped(), link_mm=LINK_MM), 0
    home = tuple(axis.homing.position for axis in built.axes)
    for seed in range(12):
        first, second = compound(seed, 2)
        way = first[1][3] - first[1][2]
        pairs = [first, moved(second, 5.0 * way / np.linalg.norm(way))]
        found += "link" in [n for chain in names(trace(text(pairs, 600.0), built, home)) for n in chain]
    assert found >= 9


def test_the_key_is_read_and_bounded() -> None:
    source = (
        (machine_file.SHIPPED / "trunnion.toml").read_text()
        + "\n"
        + (machine_file.SHIPPED / "tools.toml").read_text()
    )
    assert machine_file.read(source, "m.toml").link_mm == 0.0
    assert (
        machine_file.read(source.replace("[machine]\n", "[machine]\nlink_mm = 8\n"), "m.toml").link_mm == 8.0
    )
    for bad in ("-1", "101", '"far"'):
        with pytest.raises(machine_file.ConfigError, match="link_mm"):
            machine_file.read(source.replace("[machine]\n", f"[machine]\nlink_mm = {bad}\n"), "m.toml")
