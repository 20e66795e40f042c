"""The hot rooms run compiled and not (hatch_build.py): what must hold of the list, and of a checkout."""

from __future__ import annotations

import ast
import os
import tomllib
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

from controller import compiled

ROOT = Path(__file__).resolve().parent.parent
WHEEL = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
MODULES = WHEEL["hooks"]["custom"]["modules"]


def name_of(file: str) -> str:
    return file.removesuffix(".py").replace("/", ".")


def test_the_list_names_modules_that_are_there_in_order() -> None:
    assert sorted(set(MODULES)) == MODULES
    assert not [file for file in MODULES if not (ROOT / file).is_file()]


def test_what_is_built_on_a_class_of_a_compiled_module_is_compiled_too() -> None:
    """An interpreted class cannot be built on a native one."""
    trees = {file.relative_to(ROOT).as_posix(): ast.parse(file.read_text()) for file in sources()}
    native = {
        (name_of(file), node.name)
        for file in MODULES
        for node in ast.walk(trees[file])
        if isinstance(node, ast.ClassDef) and not {"Protocol", "IntEnum", "NamedTuple"} & bases_of(node)
    }
    for file, tree in trees.items():
        known = {
            alias.asname or alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
            if (node.module, alias.name) in native
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef) and file not in MODULES:
                assert not bases_of(node) & known, f"{file}: class {node.name}"


def bases_of(node: ast.ClassDef) -> set[str]:
    return {base.id for base in node.bases if isinstance(base, ast.Name)}


def sources() -> list[Path]:
    return [file for package in compiled.PACKAGES for file in (ROOT / package).rglob("*.py")]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A room with one compiled module, newer than its source, and one that is not."""
    room = tmp_path / "controller" / "tick"
    room.mkdir(parents=True)
    (tmp_path / "pyproject.toml").touch()
    for name in ("cycle.py", "loop.py", f"cycle{EXTENSION_SUFFIXES[0]}"):
        (room / name).touch()
    library = tmp_path / f"{compiled.GROUP}{EXTENSION_SUFFIXES[0]}"
    library.touch()
    newer_s = (room / "cycle.py").stat().st_mtime + 10.0
    os.utime(library, (newer_s, newer_s))
    return tmp_path


def later(file: Path) -> None:
    os.utime(file, (file.stat().st_mtime + 20.0,) * 2)


def test_a_source_edited_after_it_was_compiled_is_outdated(checkout: Path) -> None:
    room = checkout / "controller" / "tick"
    assert compiled.is_compiled(checkout) and compiled.outdated(checkout) is None
    later(room / "loop.py")
    assert compiled.outdated(checkout) is None, "it runs as it stands there"
    later(room / "cycle.py")
    assert compiled.outdated(checkout) == room / "cycle.py"


def test_what_is_installed_as_a_whole_is_never_outdated(checkout: Path) -> None:
    """Its files have the times of their unpacking, in any order."""
    (checkout / "pyproject.toml").unlink()
    later(checkout / "controller" / "tick" / "cycle.py")
    assert compiled.outdated(checkout) is None


def test_without_a_library_of_this_python_nothing_is_compiled(checkout: Path) -> None:
    library = checkout / f"{compiled.GROUP}{EXTENSION_SUFFIXES[0]}"
    library.rename(checkout / f"{compiled.GROUP}.cpython-27.so")
    assert not compiled.is_compiled(checkout) and compiled.outdated(checkout) is None
