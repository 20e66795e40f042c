"""The arrows of the house (DESIGN section 3): who may import whom, read from the source."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

# Room of controller -> rooms of controller that it may import; a file beside the rooms is a room of its own,
# and every room may import itself.
# Of which Directrix; how files and databases are opened.
FOR_ALL = {"version", "journald", "own_files", "own_database", "sealed_rows", "npz", "commands"}
VALUES = {"faults", "geometry", "machine", "motion", "state", "messages"}
ARROWS: dict[str, set[str]] = {
    "own_files": set(),  # no link of others is followed
    "own_database": {"atomic_file"},  # nor in the place of a SQLite file
    "journald": set(),  # what is logged, in systemd's journal
    "npz": set(),  # arrays of a file that may be damaged
    "sealed_rows": {"atomic_file"},  # rows of one with a checksum
    "atomic_file": set(),  # files replaced whole
    "sealed_file": {"atomic_file", "messages"},  # with a checksum, and the one before
    "commands": set(),  # what can be asked of the machine: one table, for all
    "faults": set(),  # what a fault is made of: words for all
    "geometry": {"messages"},
    "machine": {"geometry", "atomic_file", "sealed_file", "messages"},
    "store": {"atomic_file", "sealed_file", "machine", "messages"},  # what the service keeps, in one file
    "memory": set(),  # what a process keeps, and gives back
    "motion": {"geometry", "machine"},  # what both sides compute alike
    "messages": set(),  # texts, a file per language
    "state": {"sealed_file", "faults", "geometry", "machine", "motion", "messages"},
    "ipc": {"motion", "state", "messages", "atomic_file", "sealed_file"},  # between the processes
    "one_thread": set(),  # numpy's libraries, before they are loaded
    "version": set(),
    "workers": {"messages", "one_thread"},  # work that is spread over processes
    "program": {"geometry", "machine", "messages"},
    "plan": {"geometry", "machine", "motion", "state", "messages", "memory", "ipc", "program", "sealed_file"},
    "tick": {"geometry", "machine", "motion", "state", "ipc"},
    "verify": VALUES | {"workers", "memory", "ipc", "program", "plan"},
    # The machine's own geometry, and how a part lies, from what was measured.
    "calibration": VALUES | {"atomic_file", "program", "plan"},
    # A new machine step by step: moved, measured, and what came of it on record.
    "bringup": VALUES | {"atomic_file", "sealed_file", "ipc", "program", "verify", "calibration", "runtime"},
    # Puts the parts together: clock, tick, plan and drives.
    "runtime": VALUES
    | {"sealed_file", "workers", "memory", "ipc", "program", "plan", "tick", "verify", "one_thread"},
    # The process of `serve`: parent of tick and plan, and the far side of the control socket.
    "service": VALUES
    | {"atomic_file", "sealed_file", "store", "memory", "ipc", "program", "plan", "tick", "runtime"},
    "api": VALUES
    | {"atomic_file", "sealed_file", "store", "ipc", "program", "plan", "verify", "calibration", "bringup"},
    "web": {"api", "messages"},
    "cad": {
        "geometry",
        "machine",
        "messages",
        "program",
        "plan",
    },  # faces, or rows of lines, as a program
    "post": {"geometry", "machine", "motion", "program", "plan"},  # a planned path as lines
    # Verbs of the command line: free, but for tick.
    "cli": VALUES
    | {
        "atomic_file",
        "sealed_file",
        "store",
        "memory",
        "workers",
        "ipc",
        "program",
        "plan",
        "verify",
        "calibration",
        "bringup",
        "runtime",
        "service",
        "api",
        "web",
        "cad",
        "post",
    },
}

# Parts of drives that are values and tables, for all.
OF_DRIVES = {
    *("settings", "arranged", "profile", "scale", "pdo", "cia402", "emergency_codes", "sheet_text"),
    "text_file",  # what a machine file names, as its text
    "values",  # how dataclasses are made
    "texts",  # how a text travels, and becomes words
}

# Room of a folder -> rooms of it that it may import; files beside the rooms may import all.
ROOMS: dict[str, dict[str, set[str]]] = {
    "controller/program": {"contour": set()},  # lines and arcs in a plane, as numbers
    "controller/plan": {
        "banded": set(),  # linear systems
        "junctions": set(),  # where rates jump
        "segment": set(),  # what a path is made of
        "context": set(),  # what all parts of a trace work with
        "rotaries": {"segment"},
        "surfaces": {"segment", "context", "rotaries"},
        "lines": {"segment", "context", "rotaries", "surfaces", "banded", "junctions"},
        "path": {"segment", "context", "rotaries", "surfaces", "lines"},
        "restart": {"segment", "rotaries", "surfaces", "path"},
        "feed": {"segment", "rotaries", "surfaces", "banded", "junctions"},
        "stops": {"feed", "junctions"},
    },
    "drives": {
        "load": OF_DRIVES,
        "log": OF_DRIVES,
        "ports": OF_DRIVES,
        "pump": OF_DRIVES | {"ports", "real_time"},  # below the tick
        "cyclic": OF_DRIVES | {"ports", "pump"},
        "commissioning": OF_DRIVES,
        "bench": OF_DRIVES | {"bus", "ports", "load", "log"},
    },
    "drives/bench": {
        "virtual": set(),
        "simulated": {"virtual"},
    },
}

# Who may import which part of drives ("*" = all).
TO_DRIVES: dict[str, set[str]] = {
    "values": {"values"},
    "messages": {"texts"},
    "own_files": {"texts"},
    "own_database": {"texts"},
    "machine": {"settings", "profile", "arranged", "text_file"},
    "state": {"settings", "arranged", "pdo"},  # what the stops take; whose frames are whose
    "tick": {"settings", "scale", "cia402", "pdo", "bus", "cyclic", "pump"},
    "runtime": OF_DRIVES
    | {"bus", "cyclic", "pump", "load", "log", "ports", "commission", "bench", "real_time"},
    "service": OF_DRIVES | {"bus", "load", "log"},
    "verify": {"load"},  # to show it
    "cli": {"*"},
    "__main__": {"*"},
}

# Simulated devices, virtual buses and faults, and the only file outside of them that may import them: the
# processes of a real machine load nothing of it.
BENCH = ("drives/bench/", "controller/runtime/bench/")
DOOR_TO_BENCH = "controller/runtime/simulation.py"

# Outside package -> the only files that may import it.
ONLY_IN: dict[str, set[str]] = {
    "can": {"drives/bus.py", "drives/bench/virtual/hub_bus.py"},
    "canopen": {
        "drives/commissioning/network.py",
        "drives/commissioning/remote.py",
        "drives/commissioning/sheet.py",
        "drives/commissioning/dcf.py",
        "drives/commissioning/overrides.py",
        "drives/commissioning/possible.py",
    },
    "OCP": {"controller/cad/kernel.py"},
}

# The tick calculates on plain floats and never waits for a lock (DESIGN sections 2, 3, 5).
NOT_IN_TICK = {"numpy", "logging", "threading", "asyncio", "concurrent", "multiprocessing", "queue"}

# What runs in the tick's process, builds of machines that it finds by their folder among it. What these load
# with themselves has no numpy: its libraries would be 80 of the 114 MB that the process locks. Formulas that
# also serve samples load it where they are given some.
TICKS_PROCESS = ("controller/runtime/tick_process.py", "controller/tick/", "controller/machine/kinematics/")


def sources() -> list[Path]:
    return sorted(p for folder in ("controller", "drives") for p in (ROOT / folder).rglob("*.py"))


def imports(source: str, path: str) -> Iterator[tuple[int, str]]:
    """(line, dotted name) of every import anywhere in a file, also inside functions.

    ``from a import b`` gives ``a.b``: whether b is a module or a name in one, the part
    that it belongs to is the same. Relative imports are made absolute.
    """
    yield from named(ast.walk(ast.parse(source, path)), path)


def named(nodes: Iterable[ast.AST], path: str) -> Iterator[tuple[int, str]]:
    """Of those of these nodes that import something."""
    package = list(Path(path).with_suffix("").parts[:-1])
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            up = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*up, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{base}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Call) and _is_import_call(node.func):
            name = node.args[0] if node.args else None
            if isinstance(name, ast.Constant) and isinstance(name.value, str):
                yield node.lineno, name.value


def _is_import_call(function: ast.expr) -> bool:
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    return name in ("import_module", "__import__", "run_module")


def wrong_imports(source: str, path: str) -> list[str]:
    """A sentence per import that no arrow allows."""
    parts = Path(path).with_suffix("").parts
    home, part = parts[0], parts[1]
    found = []
    for line, name in imports(source, path):
        top, *rest = name.split(".")
        reason = (
            _outside(top, path, home, part)
            or _inside(top, rest, home, part)
            or _room(name, path)
            or _bench(name, path)
        )
        if reason:
            found.append(f"{path}:{line}: imports {name}: {reason}")
    return found


def _outside(top: str, path: str, home: str, part: str) -> str:
    if top in ONLY_IN and path not in ONLY_IN[top]:
        return f"only {' and '.join(sorted(ONLY_IN[top]))} may import {top}"
    if (home, part) == ("controller", "tick") and top in NOT_IN_TICK:
        return f"the tick uses no {top}"
    return ""


def _inside(top: str, rest: list[str], home: str, part: str) -> str:
    if home == "drives":
        return "drives imports nothing from controller" if top == "controller" else ""
    if top == "controller" and part != "__main__" and rest:
        return (
            ""
            if rest[0] in ARROWS.get(part, set()) | FOR_ALL | {part}
            else f"no arrow from {part} to {rest[0]}"
        )
    if top == "drives":
        allowed = TO_DRIVES.get(part, set())
        sound = "*" in allowed or (rest and rest[0] in allowed)
        return "" if sound else f"no arrow from {part} to drives.{rest[0] if rest else '*'}"
    return ""


def _room(name: str, path: str) -> str:
    """Within a folder of rooms."""
    for folder, rooms in ROOMS.items():
        within, package = path.removeprefix(folder + "/"), folder.replace("/", ".") + "."
        if within == path or not name.startswith(package):
            continue
        room, to = within.split("/")[0], name.removeprefix(package).split(".")[0]
        if room in rooms and to not in rooms[room] | {room}:
            return f"no arrow from the room {room} to {to}"
    return ""


def _bench(name: str, path: str) -> str:
    """Into the bench."""
    within = f"{name.replace('.', '/')}/".startswith(BENCH)
    return (
        f"only {DOOR_TO_BENCH} imports the bench"
        if within and not path.startswith((*BENCH, DOOR_TO_BENCH))
        else ""
    )


def test_no_file_imports_along_an_arrow_that_is_not_drawn() -> None:
    wrong = [w for p in sources() for w in wrong_imports(p.read_text(), p.relative_to(ROOT).as_posix())]
    assert not wrong, "\n".join(wrong)


def loads(source: str, path: str) -> Iterator[str]:
    """Dotted names of what a module loads when it is loaded: not for types alone, not inside functions."""
    yield from (name for _, name in named(_at_once(ast.parse(source, path)), path))


def _at_once(node: ast.AST) -> Iterator[ast.AST]:
    yield node
    for_types = isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    for part in node.orelse if for_types else ast.iter_child_nodes(node):
        if not isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield from _at_once(part)


def numpy_by(roots: Iterable[str], source_of: Callable[[str], str]) -> list[str]:
    """The way from a root to a file that loads numpy, for each such file: names of files."""
    ways = {root: (root,) for root in roots}
    found, waiting = [], list(ways)
    while waiting:
        file = waiting.pop()
        for name in loads(source_of(file), file):
            if name.split(".")[0] == "numpy":
                found.append(" -> ".join(ways[file]))
            for to in _files(name):
                if to not in ways:
                    ways[to] = (*ways[file], to)
                    waiting.append(to)
    return found


def _files(name: str) -> Iterator[str]:
    """The module of a dotted name, or the one that it is a name in, and the packages about it."""
    parts = name.split(".")
    for n in range(1, len(parts) + 1):
        place = ROOT.joinpath(*parts[:n])
        for file in (place.with_suffix(".py"), place / "__init__.py"):
            if parts[0] in ("controller", "drives") and file.is_file():
                yield file.relative_to(ROOT).as_posix()


def of_the_ticks_process() -> list[str]:
    files = (file.relative_to(ROOT).as_posix() for file in sources())
    return [file for file in files if file.startswith(TICKS_PROCESS)]


def test_nothing_that_the_ticks_process_loads_loads_numpy() -> None:
    roots = of_the_ticks_process()
    assert len(roots) > 20
    assert numpy_by(roots, lambda file: (ROOT / file).read_text()) == []


NEEDS_NUMPY = [
    ("controller/geometry/curves.py", "import numpy as np", True),
    ("controller/geometry/curves.py", "from numpy.typing import NDArray", True),
    ("controller/geometry/curves.py", "class Even:\n    import numpy as np", True),
    ("controller/geometry/curves.py", "from controller.geometry import arrays", True),
    ("controller/geometry/curves.py", "if not TYPE_CHECKING:\n    import numpy", True),
    ("controller/geometry/curves.py", "if TYPE_CHECKING:\n    import numpy", False),
    ("controller/geometry/curves.py", "if TYPE_CHECKING:\n    pass\nelse:\n    import numpy", True),
    ("controller/geometry/curves.py", "def along(u):\n    import numpy as np", False),
]


@pytest.mark.parametrize(("file", "planted", "is_loaded"), NEEDS_NUMPY)
def test_numpy_planted_below_the_tick_is_found(file: str, planted: str, is_loaded: bool) -> None:
    def source_of(asked: str) -> str:
        return planted if asked == file else (ROOT / asked).read_text()

    found = numpy_by(["controller/tick/follow.py"], source_of)
    assert bool(found) is is_loaded
    assert all("follow.py -> " in way and file in way for way in found)


def test_every_part_of_the_controller_has_its_place_in_the_drawing() -> None:
    parts = {p.relative_to(ROOT).with_suffix("").parts[1] for p in sources() if "controller" in p.parts}
    assert parts - {"__init__", "__main__"} <= set(ARROWS)


def test_the_drawing_itself_has_no_way_round() -> None:
    """Arrows make an order: taking away what points to nothing left empties the drawing."""
    left = {part: set(to) for part, to in ARROWS.items()}
    while ends := {part for part, to in left.items() if not to & left.keys()}:
        left = {part: to for part, to in left.items() if part not in ends}
    assert not left, f"these point at each other: {sorted(left)}"


def circles(tree: Mapping[str, str]) -> list[str]:
    """Modules that import each other, straight or by others, for types or inside functions: their files.

    ``tree``: source by file. Taking away what imports nothing that is left, and what nothing left imports,
    leaves circles, and what is between two of them.
    """
    left = {file: set(_imported(source, file)) & tree.keys() - {file} for file, source in tree.items()}
    while left:
        imported = set().union(*left.values())
        ends = {file for file, to in left.items() if not to or file not in imported}
        if not ends:
            break
        left = {file: to - ends for file, to in left.items() if file not in ends}
    return sorted(left)


def _imported(source: str, path: str) -> Iterator[str]:
    """The files that a module names, not the packages about them."""
    for _, name in imports(source, path):
        yield from list(_files(name))[-1:]


def test_no_modules_import_each_other() -> None:
    assert circles({path.relative_to(ROOT).as_posix(): path.read_text() for path in sources()}) == []


FOLLOW, LOOP = "from controller.tick import follow", "from controller.tick.loop import Loop"
LEADS_BACK = [
    # file, source, why it must be found
    ("controller/tick/follow.py", LOOP, "as it is loaded"),
    ("controller/tick/follow.py", "if TYPE_CHECKING:\n    from . import loop", "for types alone"),
    ("controller/tick/follow.py", "def f():\n    import controller.tick.loop", "inside a function"),
]


@pytest.mark.parametrize(("path", "source", "reason"), LEADS_BACK)
def test_a_planted_circle_is_found(path: str, source: str, reason: str) -> None:
    others = {"controller/tick/loop.py": FOLLOW, "controller/tick/cycle.py": LOOP}
    assert circles({path: "", **others}) == []
    assert circles({path: source, **others}) == sorted([path, "controller/tick/loop.py"]), reason


PLANTED = [
    # file, source, why it must be found
    ("controller/plan/path/path.py", "from controller.tick import loop", "plan must not know the tick"),
    ("controller/plan/path/path.py", "def f():\n    import controller.tick.loop", "also inside a function"),
    ("controller/tick/loop.py", "from ..plan import profile", "also a relative import"),
    ("controller/tick/loop.py", "from controller import plan", "also by the package"),
    ("controller/tick/loop.py", "from controller.api import http", "never tick to panel"),
    ("controller/tick/cycle.py", "import numpy as np", "plain floats in the tick"),
    ("controller/tick/cycle.py", "import logging", "no log in the tick"),
    ("controller/tick/loop.py", "from threading import Lock", "no lock in the tick"),
    ("controller/tick/loop.py", "from drives import commission", "no SDO in the real-time process"),
    ("controller/tick/loop.py", "import drives", "the whole package is not one of its files"),
    (
        "controller/geometry/curves.py",
        "from controller.machine.kinematics import X",
        "curves know no machine",
    ),
    ("controller/geometry/vectors.py", "from controller import machine", "a leaf imports no other part"),
    (
        "controller/machine/machine_file.py",
        "from controller.motion import motions",
        "a machine moves nothing",
    ),
    (
        "controller/plan/path/path.py",
        "from drives.cyclic.group import Group",
        "only the tick speaks to drives",
    ),
    ("controller/program/words.py", "from controller.plan.feed import limits", "text knows no limits"),
    (
        "controller/plan/path/path.py",
        "from controller.plan.feed import profile",
        "first the way",
    ),
    ("drives/cyclic/group.py", "from drives.bench.virtual.hub import Hub", "the tick's side knows no hub"),
    ("controller/unknown.py", "from controller.geometry.vectors import X", "a part that is not drawn"),
    ("drives/cyclic/group.py", "from controller.machine.model import Axis", "drives stand on their own"),
    (
        "drives/bench/simulated/node.py",
        "import importlib\nimportlib.import_module('controller')",
        "also by call",
    ),
    ("drives/cyclic/group.py", "def f():\n    import can", "python-can has one door"),
    ("drives/bench/simulated/node.py", "import canopen.sdo", "canopen has one door"),
    ("controller/__main__.py", "import canopen", "for the command line, too"),
    ("controller/cad/strip.py", "from OCP.gp import gp_Pnt", "OpenCASCADE has one door"),
    ("controller/runtime/stepped.py", "from drives.bench.simulated.rig import Rig", "the bench has one door"),
    ("controller/cli/serve.py", "def f():\n    from controller.runtime.bench import bus", "for verbs, too"),
    ("controller/runtime/replay.py", "from controller.runtime import bench", "also as a whole"),
    ("drives/bus.py", "from drives.bench.virtual.hub import Hub", "the bus side knows no hub"),
    ("drives/one_axis.py", "import drives.bench", "nor the bench as a whole"),
]


@pytest.mark.parametrize(("path", "source", "reason"), PLANTED)
def test_a_planted_arrow_is_found(path: str, source: str, reason: str) -> None:
    assert wrong_imports(source, path), reason


DRAWN = [
    ("controller/tick/cycle.py", "from drives.cyclic.group import Group\nfrom . import follow\nimport math"),
    ("controller/plan/feed/limits.py", "import numpy as np\nfrom controller.motion import motions"),
    ("controller/__main__.py", "from controller import machine, tick\nfrom drives import commission"),
    ("controller/machine/machine_file.py", "from drives.settings import NodeSettings"),
    ("drives/bus.py", "def f():\n    import can"),
    ("drives/bench/simulated/node.py", "from ..virtual.virtual_bus import connect"),
    ("controller/runtime/simulation.py", "from drives.bench.simulated.rig import Rig"),
    ("controller/runtime/bench/bus.py", "from drives.bench.virtual.hub import Hub"),
]


@pytest.mark.parametrize(("path", "source"), DRAWN)
def test_a_drawn_arrow_is_left_alone(path: str, source: str) -> None:
    assert wrong_imports(source, path) == []
