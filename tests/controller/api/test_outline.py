"""A program's path as a small picture: all that is cut is in it, and the place that is refused stands out."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.api import outline
from controller.api.store import Program, Store
from controller.cli import check_worker
from controller.machine import machine_file, setup_data
from controller.plan.report import picture
from controller.plan.report.picture import FEED, RAPID, Shape

HEIGHT = 300
SVG = "{http://www.w3.org/2000/svg}"
HEAD = b"G21 G90 G54\nT1 M6\nM3 S1000\nG0 X0 Y0 Z20\n"
SQUARE = HEAD + b"G1 Z0 F500\nG1 X20\nG1 Y20\nG1 X0\nG1 Y0\nG0 Z20\nM30\n"


def shape_of(tips: list[list[float]], kinds: list[int], lines: list[int]) -> Shape:
    n = len(tips)
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    points, whole = np.array(tips, dtype=float).reshape(-1, 3), np.array
    return Shape(
        points, whole(kinds), np.arange(n), whole(lines), np.empty((0, 6)), np.empty(0, dtype=int), 0.0, up
    )


def drawn(svg: str) -> dict[str, list[list[tuple[float, float]]]]:
    """The polylines of each class, and the middles of rings as those of one point."""
    found: dict[str, list[list[tuple[float, float]]]] = {}
    for one in ET.fromstring(svg):
        if one.tag == f"{SVG}path":
            for line in one.attrib["d"].split("M")[1:]:
                points = [tuple(map(float, xy.split())) for xy in line.rstrip("Z").split("L")]
                found.setdefault(one.attrib["class"], []).append(points)  # type: ignore[arg-type]
        if one.tag == f"{SVG}circle":
            found.setdefault("ring", []).append([(float(one.attrib["cx"]), float(one.attrib["cy"]))])
    return found


def test_what_is_fed_fills_the_picture_and_rapids_are_apart() -> None:
    tips = [[0, 0, 500], [0, 0, 10], [0, 0, 0], [50, 0, 0], [50, 40, 0], [0, 0, 0]]
    made = drawn(outline.svg(shape_of(tips, [RAPID, RAPID, FEED, FEED, FEED, FEED], list(range(6))), HEIGHT))
    (fed,) = made["feed"]
    xs, ys = [x for x, _ in fed], [y for _, y in fed]
    room = HEIGHT * (1.0 - 2.0 * outline.MARGIN)
    assert max(xs) - min(xs) == pytest.approx(HEIGHT / 3.0 + room, abs=0.2) or max(ys) - min(
        ys
    ) == pytest.approx(room, abs=0.2)
    assert min(*xs, *ys) >= 0.0 and max(ys) <= HEIGHT and max(xs) <= HEIGHT * 4 / 3
    assert made["rapid"][0][0][1] < 0.0, "from far above"
    assert fed[0] == made["rapid"][0][-1], "they meet"


def test_what_is_nearer_lies_lower_and_what_is_higher_lies_higher() -> None:
    at = outline._screen(shape_of([[0, 0, 0], [10, 10, 10]], [FEED, FEED], [1, 2]), np.zeros(2, bool), HEIGHT)
    near, far, low, high = at(np.array([[5, 0, 0], [5, 10, 0], [5, 5, 0], [5, 5, 10.0]]))
    assert near[1] > far[1] and low[1] > high[1] and low[0] == pytest.approx(high[0])


def test_a_picture_is_as_light_as_its_size_lets_it_be() -> None:
    turns = np.linspace(0.0, 60.0, picture.MAX_POINTS)
    tips = np.stack([turns * np.cos(turns), turns * np.sin(turns), turns], axis=1)
    shape = shape_of(tips.tolist(), [FEED] * len(turns), [1] * len(turns))
    sizes = [len(outline.svg(shape, height)) for height in (54, 360)]
    assert sizes[0] < 12_000 and sizes[0] < sizes[1] < 60_000
    lines = drawn(outline.svg(shape, 360))["feed"][0]
    assert len(lines) > 300, "round, not cornered"


def test_nothing_and_a_single_place_are_pictures_too() -> None:
    ET.fromstring(outline.svg(shape_of([], [], []), HEIGHT))
    ET.fromstring(outline.svg(shape_of([[1, 2, 3], [1, 2, 3]], [FEED, FEED], [1, 1]), HEIGHT))


# ---- as the check of a program leaves it


@pytest.fixture
def store(tmp_path: Path) -> Store:
    setup_data.note(tmp_path, machine_file.load("trunnion"))
    return Store(tmp_path)


def checked(store: Store, text: bytes, files: dict[str, bytes] | None = None) -> tuple[str, dict[str, Any]]:
    kept: dict[str, Program] = {}
    for name, content in {**(files or {}), "part.ngc": text}.items():
        with store.uploads.begin(name) as upload:
            upload.write(content)
            kept[name] = upload.commit()
    program = kept["part.ngc"]
    job = {
        **{"name": "part.ngc", "program": store.programs.path(program.sha256), "lines": text.count(b"\n")},
        **{"state": store.folder, "files": store.programs.called(program)},
    }
    return check_worker.check(job, lambda _: None)


def picture_of(store: Store, result: dict[str, Any]) -> dict[str, list[list[tuple[float, float]]]]:
    shape = picture.load(store.own / "pictures" / f"{result['pictured']}.npz")
    return drawn(outline.svg(shape, HEIGHT, outline.guilty_of(shape, result)))


def test_a_sound_program_has_nothing_in_red(store: Store) -> None:
    state, result = checked(store, SQUARE)
    assert state == "passed"
    shape = picture.load(store.own / "pictures" / f"{result['stored']}.npz")
    assert not outline.guilty_of(shape, result).any()
    assert len(drawn(outline.svg(shape, HEIGHT))["feed"][0]) == 6


def test_a_line_that_cannot_be_read_is_ringed_where_the_program_has_come_to_and_the_rest_is_drawn(
    store: Store,
) -> None:
    wrong = SQUARE.replace(b"G1 X0\n", b"G1 X0 QQ\n")
    state, result = checked(store, wrong)
    assert (state, result["line"], result["guilty_lines"]) == ("refused", 8, [8])
    shape = picture.load(store.own / "pictures" / f"{result['pictured']}.npz")
    guilty = np.flatnonzero(outline.guilty_of(shape, result))
    assert len(guilty) == 1 and shape.tips[guilty[0]] == pytest.approx(shape.tips[shape.lines == 7][-1])
    assert (shape.lines == 9).any(), "and on behind it"
    made = picture_of(store, result)
    assert len(made["ring"]) == len(made["guilty"]) == 1


def test_where_an_axis_would_leave_its_travel_the_path_ends_in_a_ring(store: Store) -> None:
    state, result = checked(store, SQUARE.replace(b"G1 X0\n", b"G1 X9999\n"))
    assert (state, result["guilty_lines"]) == ("refused", [8])
    shape = picture.load(store.own / "pictures" / f"{result['pictured']}.npz")
    assert shape.lines.max() == 7 and np.flatnonzero(outline.guilty_of(shape, result)).tolist() == [
        len(shape.lines) - 1
    ]


def test_a_gouge_is_drawn_whole_with_its_own_line_in_red(store: Store) -> None:
    text = machine_file.shipped_program("example2").read_bytes()
    state, result = checked(store, text)
    assert (state, result["key"]) == ("refused", "gouge.refused")
    shape = picture.load(store.own / "pictures" / f"{result['pictured']}.npz")
    guilty = outline.guilty_of(shape, result)
    assert guilty.any() and set(shape.lines[guilty]) == set(result["guilty_lines"])
    assert picture_of(store, result)["guilty"]


@pytest.mark.parametrize("wrong", ["G1 X1O", "G1 X9999"], ids=["unread", "beyond travel"])
def test_a_mistake_in_a_called_file_marks_the_line_that_calls_it(store: Store, wrong: str) -> None:
    calls = HEAD + b"G1 Z0 F500\no5 call\nG1 X5\nM30\n"
    state, result = checked(store, calls, {"5.ngc": f"o5 sub\n{wrong}\no5 endsub\n".encode()})
    line = calls[: calls.index(b"o5 call")].count(b"\n") + 1
    assert (state, result["file"], result["line"], result["called_at"]) == ("refused", "5.ngc", 2, line)
    assert result["guilty_lines"] == [line]
    shape = picture.load(store.own / "pictures" / f"{result['pictured']}.npz")
    assert outline.guilty_of(shape, result).any()


def test_a_mistake_in_a_file_that_a_called_file_calls_marks_the_programs_own_line(store: Store) -> None:
    calls = HEAD + b"o4 sub\no5 call\no4 endsub\nG1 Z0 F500\no4 call\nG1 X5\nM30\n"
    files = {"5.ngc": b"o5 sub\no6 call\no5 endsub\n", "6.ngc": b"o6 sub\nG1 X1O\no6 endsub\n"}
    state, result = checked(store, calls, files)
    line = calls[: calls.index(b"o5 call")].count(b"\n") + 1
    assert (state, result["file"], result["called_at"]) == ("refused", "6.ngc", line)


def test_a_program_of_which_nothing_moves_has_no_picture(store: Store) -> None:
    state, result = checked(store, b"G21 QQ\nM30\n")
    assert state == "refused" and "pictured" not in result


def test_the_classes_that_are_drawn_are_those_that_have_a_colour() -> None:
    styled = set(re.findall(r"\.(\w+)[{,]", outline.STYLE))
    assert styled == {"rapid", "feed", "cut", "wall", "guilty"}
