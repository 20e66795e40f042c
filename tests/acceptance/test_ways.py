"""What a machine does between cuts, by page, REST, command and program: config/README.md's table is true.

A row that names what is not there fails, and so does a route, a command or an option, a cycle, or a part of
the page's set-up of those rooms that no row names: so nothing comes by one way alone unnoticed.
"""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, NamedTuple

import click
import pytest
import typer.main
from support.fakes.panels import Scene

from controller import messages
from controller.__main__ import FILES, app
from controller.api.http import API
from controller.machine import machine_file
from controller.program import linked, refusals
from controller.program.probing_cycles import CYCLES

ROOT = Path(__file__).resolve().parents[2]
STATIC = ROOT / "controller" / "web" / "static"
TABLE = (ROOT / "config" / "README.md").read_text().split("<!-- ways -->")[1].split("<!-- end of ways -->")[0]
NOTES = (ROOT / "config" / "README.md").read_text().split("<!-- end of ways -->")[1].split("\n## ")[0]
PAGE, REST, COMMAND, PROGRAM = "page", "REST", "command", "program"

ROOMS = {"offsets and tools", "tool changer", "probing", "canned cycles", "calibration"}
ROOMS |= {"tool life and maintenance"}
BESIDE = {  # routes of other rooms that are about the same
    *("PUT machine/spindle", "PUT machine/coolant", "PUT machine/clamps", "PUT overrides/spindle"),
    "POST cycle/withdraw",
}
BY_HAND = {"spindle", "coolant", "clamps"}
OF_ROOMS = ("offsets", "tools", "equipment", "calibrate")
ALL_HAVE = {"url", "take_over", "as_json", "language"}
OTHER_PARTS = {"homing", "bring_up", "file", "backup", "drives", "users", "notices"}  # of the page's set-up


class Row(NamedTuple):
    """Names in a cell; none where a note says why."""

    what: str
    page: str
    names: dict[str, list[str]]
    notes: dict[str, str]


def rows() -> list[Row]:
    found = []
    for line in TABLE.strip().splitlines()[2:]:
        what, *cells = (cell.strip() for cell in line.strip("|").split(" | "))
        of = dict(zip((PAGE, REST, COMMAND, PROGRAM), (cell.strip(" |") for cell in cells), strict=True))
        names = {way: re.findall(r"`([^`]+)`", cell) for way, cell in of.items()}
        notes = {way: "".join(re.findall(r"\(([a-z])\)$", cell)) for way, cell in of.items()}
        page = "" if of[PAGE].startswith("–") else of[PAGE].split(" (")[0]
        found.append(Row(what.strip("| "), page, names, notes))
    return found


ROWS = rows()


def named(way: str) -> set[str]:
    return {name for row in ROWS for name in row.names[way]}


# ---- what there is


def routes() -> dict[str, list[str]]:
    """``METHOD path`` below the interface, with its tags."""
    paths = Scene(Path(mkdtemp())).app.openapi()["paths"]
    return {
        f"{method.upper()} {path.removeprefix(API + '/')}": facts["tags"]
        for path, methods in paths.items()
        for method, facts in methods.items()
        if path.startswith(API)
    }


def commands() -> dict[str, click.Command]:
    """By name, those below others too."""
    top: Any = typer.main.get_command(app)
    found: dict[str, click.Command] = {}
    for name in (one for names in FILES.values() for one in names):
        found[name] = command = top.load(name)
        for below, one in getattr(command, "commands", {}).items():
            found[f"{name} {below}"] = one
    return found


def options(command: click.Command) -> dict[str, str]:
    """``--option`` -> name of its parameter, of those that are not of every command."""
    return {
        max(one.opts, key=len): str(one.name)
        for one in command.params
        if isinstance(one, click.Option) or getattr(one, "param_type_name", "") == "option"
        if one.name not in ALL_HAVE
    }


@pytest.fixture(scope="module")
def there() -> dict[str, click.Command]:
    return commands()


def scripts() -> str:
    whole = "\n".join(file.read_text() for file in STATIC.rglob("*.js") if "vendor" not in file.parts)
    return re.sub(r"""change\("(\w+)", (["`])""", r"""call("\1", \2usage/""", whole)  # as that of usage does


def is_asked_by(script: str, route: str) -> bool:
    """Whether a script of the page asks that route: by ``call``, a button, a look, a link or a picture."""
    method, path = route.split(" ")
    pattern = re.sub(r"\\\{\w+\\\}", r"\\$\\{.+?\\}", re.escape(path))
    if method == "GET":
        return re.search(rf"""["`}}/]{pattern}["`?]""", script) is not None
    return re.search(rf"""\(?["`]{method}[" ,`]+{pattern}["`]""", script) is not None


# ---- each row is true


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.what)
def test_a_row_names_something_by_each_way_or_says_why_not(row: Row) -> None:
    for way in (REST, COMMAND, PROGRAM):
        assert row.names[way] or re.search(rf"^\({row.notes[way]}\) \S", NOTES, re.M), (row.what, way)
        assert row.names[way] or row.notes[way], (row.what, way)
    assert row.page or row.notes[PAGE]


def test_every_route_of_the_table_is_there() -> None:
    assert not named(REST) - set(routes())


def test_every_route_of_a_row_with_a_page_is_asked_by_the_page() -> None:
    script = scripts()
    asked = {route for row in ROWS if row.page for route in row.names[REST]}
    asked -= {"GET changer"}  # the status has it
    asked -= {
        "GET cycles",
        "GET cycles/{code}.svg",
    }  # the editor asks by the code of its line, see test_editor
    assert not [route for route in sorted(asked) if not is_asked_by(script, route)]


def test_every_page_of_the_table_is_there_in_every_language() -> None:
    english = messages.of("en").page
    parts = re.search(r"const PARTS = \{(.+?)\}", (STATIC / "views" / "setup.js").read_text())
    assert parts is not None
    for page in {row.page for row in ROWS if row.page}:
        view, _, part = page.partition(": ")
        of = "setup." if part else "view."
        keys = [key for key, text in english.items() if key.startswith(of) and text == (part or view)]
        assert keys, page
        assert not part or any(f"{key.removeprefix('setup.')}:" in parts[1] for key in keys), page
        assert all(key in messages.of(language).page for language in messages.LANGUAGES for key in keys)


def test_every_command_of_the_table_is_there(there: dict[str, click.Command]) -> None:
    for name in named(COMMAND):
        words = name.split(" --")
        assert words[0] in there, name
        assert len(words) == 1 or f"--{words[1]}" in options(there[words[0]]), name


@pytest.mark.parametrize("line", sorted(named(PROGRAM)))
def test_every_word_of_the_table_is_read(line: str) -> None:
    machine = machine_file.load("trunnion" if line.startswith("M61") else "machining_centre")  # no changer
    on_setter = line.startswith("o<probe_tool")
    cutter = on_setter or line.startswith(("G10 L1 ", "M3 ", "M4 "))
    tool = "T2 M6\nG43 H2\n" if cutter else "T99 M6\nG43 H99\n"
    tool = "" if line.startswith(("T2", "M61")) else tool
    place = "G53 G0 Z300\nG53 G0 X-80 Y-40" if on_setter else "G0 X0 Y0 Z100"
    program = f"G21 G90 G94 G54 F100\n{tool}{place}\n{line}\nM30\n"
    text = linked.linked(program.encode(), lambda _: None)
    assert [str(one) for one in refusals.of(bytes(text), machine, "row.ngc")] == []


# ---- nothing of these rooms is beside the table


def test_every_route_of_these_rooms_stands_in_a_row() -> None:
    there = {route for route, tags in routes().items() if ROOMS & set(tags)} | BESIDE
    assert not there - named(REST)


def test_every_command_and_option_of_these_rooms_stands_in_a_row(there: dict[str, click.Command]) -> None:
    rooms = {name for file in OF_ROOMS for name in FILES[file]} | BY_HAND
    for name, command in there.items():
        top, _, below = name.partition(" ")
        if top not in rooms:
            continue
        assert name in named(COMMAND), name
        if top != "calibrate" and not below:
            assert not {f"{name} {option}" for option in options(command)} - named(COMMAND)


def test_every_part_of_the_set_up_stands_in_a_row() -> None:
    parts = re.search(r"const PARTS = \{(.+?)\}", (STATIC / "views" / "setup.js").read_text())
    assert parts is not None
    english = messages.of("en").page
    shown = {english[f"setup.{one}"] for one in re.findall(r"(\w+):", parts[1]) if one not in OTHER_PARTS}
    assert shown == {row.page.partition(": ")[2] for row in ROWS if ": " in row.page}


def test_every_cycle_stands_in_a_row_and_has_its_picture_on_every_page_that_shows_it() -> None:
    called = {match[1] for line in named(PROGRAM) if (match := re.match(r"o<probe_(\w+)> call", line))}
    assert called == set(CYCLES)
    readme = (ROOT / "config" / "programs" / "README.md").read_text()
    for cycle in CYCLES:
        assert f"](probing/probe_{cycle}.svg)" in readme
        assert (linked.SHIPPED / f"probe_{cycle}.svg").is_file()
        for language in messages.LANGUAGES:
            assert f"probing.cycle.{cycle}" in messages.of(language).page
    drawn = {file.stem for file in (ROOT / "config" / "programs" / "cycles").glob("*.svg")}
    assert {f"](cycles/{code}.svg)" in readme for code in drawn} == {True}
