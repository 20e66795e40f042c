"""What the files of ``controller/cli`` declare, without what their commands work with: enough for help.

    with declarations.only():
        module = importlib.import_module("controller.cli.post")

``--help`` and completion need signatures and docstrings. What bodies work with (numpy, planner, drives)
takes most of a second to import, so bodies are left out here, and with them every import that nothing but
bodies asks for, and what is made of such an import. So every file may import at its top, as anywhere.
"""

from __future__ import annotations

import ast
import contextlib
import marshal
import os
import struct
import sys
from collections.abc import Iterator, Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import MAGIC_NUMBER, cache_from_source
from types import CodeType, ModuleType
from typing import TypeGuard

ROOM = "controller.cli"
WHOLE = {ROOM + ".speech", ROOM + ".commands"}  # their functions make declarations
LIGHT = (
    ROOM,
    "controller.commands",
    "controller.messages",
    "controller.verify.console",
    "controller.ipc.control_socket",
)
STANDARD = {*sys.stdlib_module_names, "typer"}
REGISTER = "register"  # the function of a file whose body declares
WHOLLY = "DIRECTRIX_WHOLLY"  # environment: never without bodies
COMPLETES = "_DIRECTRIX_COMPLETE"  # environment: a shell asks
RAISES = ast.parse("from controller.cli import declarations\nraise declarations.Undeclared").body

Import = ast.Import | ast.ImportFrom


class Undeclared(Exception):
    """A command is run whose body was left out."""


def asked_for() -> bool:
    """Whether this process is to answer help or completion."""
    return (is_shown() or COMPLETES in os.environ) and WHOLLY not in os.environ


def are_listed() -> bool:
    """Whether it is to list the commands, and nothing else; of "python -c" we are a library."""
    alone = len(sys.argv) == 1 and sys.argv[0] != "-c"
    return (alone or sys.argv[1:] == ["--help"]) and COMPLETES not in os.environ


def is_shown() -> bool:
    """Whether help is what this process is asked for."""
    return are_listed() or "--help" in sys.argv


def begin_again() -> None:
    """The same command line with all bodies: ``--help`` was the value of an option."""
    os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], {**os.environ, WHOLLY: "1"})


@contextlib.contextmanager
def only() -> Iterator[None]:
    """What is imported of the room meanwhile is declarations."""
    sys.meta_path.insert(0, _Finder)
    try:
        yield
    finally:
        sys.meta_path.remove(_Finder)


class _Finder:
    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """As Python asks of a finder; of nothing else than the room."""
        spec = PathFinder.find_spec(name, path, target) if name.startswith(ROOM + ".") else None
        if spec is not None and spec.origin is not None and name not in WHOLE:
            spec.loader = _Loader(name, spec.origin)
        return spec


class _Loader(SourceFileLoader):
    def get_code(self, fullname: str) -> CodeType:
        """Kept beside Python's own, for half of the time of ``--help`` would go into it."""
        path = self.get_filename(fullname)
        kept, state = cache_from_source(path, optimization="declared"), _state_of(path, __file__)
        try:
            found = self.get_data(kept)
            if found.startswith(state):
                code: CodeType = marshal.loads(found[len(state) :])
                return code
        except (OSError, EOFError, ValueError, TypeError):
            pass  # there is none yet, or half of one
        code = compile(_declared(ast.parse(self.get_data(path))), path, "exec", dont_inherit=True)
        if not sys.dont_write_bytecode:
            self.set_data(kept, state + marshal.dumps(code))
        return code


def _state_of(*files: str) -> bytes:
    """Changes with Python and with each of the files."""
    seen = [(one.st_mtime_ns, one.st_size) for one in map(os.stat, files)]
    return MAGIC_NUMBER + b"".join(struct.pack("<QQ", *one) for one in seen)


def _declared(tree: ast.Module) -> ast.Module:
    left_out = {alias.asname or alias.name for part in tree.body if _heavy(part) for alias in part.names}
    asked = {name for part in tree.body for name in _annotations(part)} - left_out
    kept = list[ast.stmt]()
    for part in tree.body:
        bound = _bound(part)
        if bound and not bound & asked and _looked_up(part) & left_out:
            left_out |= bound
        else:
            kept.append(part)
    used = asked.union(*map(_looked_up, kept))
    return ast.Module([part for part in kept if _shortened(part, used)], [])


def _heavy(part: ast.stmt) -> TypeGuard[Import]:
    """An import of what bodies work with, as far as one can tell."""
    if isinstance(part, ast.ImportFrom):
        module = part.module or ""
        return not module.startswith(LIGHT) and module.partition(".")[0] not in STANDARD
    return isinstance(part, ast.Import) and part.names[0].name.partition(".")[0] not in STANDARD


def _annotations(part: ast.stmt) -> set[str]:
    """Names in the signature of what may be a command."""
    if not isinstance(part, ast.FunctionDef) or part.name.startswith("_"):
        return set()
    return _names(*(one.annotation for one in (*part.args.args, *part.args.kwonlyargs)))


def _bound(part: ast.stmt) -> set[str]:
    """What a class or an assignment defines."""
    if isinstance(part, ast.ClassDef):
        return {part.name}
    return _names(*getattr(part, "targets", ()), getattr(part, "target", None))


def _looked_up(part: ast.stmt) -> set[str]:
    """What is looked up when the statement is run; annotations are text."""
    if isinstance(part, ast.FunctionDef):
        wholly = part.body if part.name == REGISTER else ()
        return _names(*part.decorator_list, *part.args.defaults, *part.args.kw_defaults, *wholly)
    if isinstance(part, ast.ClassDef):
        return _names(*part.bases, *part.decorator_list).union(*map(_looked_up, part.body))
    return _names(part.value if isinstance(part, ast.AnnAssign) else part)


def _names(*roots: ast.AST | None) -> set[str]:
    found, left = set[str](), list[object](roots)
    while left:  # in half the time of ``ast.walk``
        node = left.pop()
        if isinstance(node, ast.Name):
            found.add(node.id)
        elif isinstance(node, ast.AST):
            left += vars(node).values()
        elif isinstance(node, list):
            left += node
    return found


def _shortened(part: ast.stmt, used: set[str]) -> bool:
    """Leave out, in place, what nobody uses; whether anything is left."""
    if isinstance(part, ast.FunctionDef) and part.name not in {REGISTER, *used}:
        told = part.body[:1] if ast.get_docstring(part, clean=False) else []
        part.body = [*told, *RAISES]
    elif isinstance(part, ast.ImportFrom) and (part.module or "").partition(".")[0] not in STANDARD:
        part.names = [alias for alias in part.names if (alias.asname or alias.name) in used]
        return bool(part.names)
    elif _heavy(part):
        return (part.names[0].asname or part.names[0].name) in used
    return True
