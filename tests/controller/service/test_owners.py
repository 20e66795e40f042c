"""Who owns what in the service: classes that one can keep in mind, which nobody else writes into."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from controller import service

MAX_METHODS = 20
MAX_WRITES = 1  # a flag of the standard library's timer
OWN = ("self", "cls")


def modules() -> Iterator[tuple[str, ast.Module]]:
    for file in sorted(Path(service.__path__[0]).glob("*.py")):
        yield file.name, ast.parse(file.read_text())


def too_large(module: ast.Module) -> dict[str, int]:
    """Classes with more methods, properties among them, than one keeps in mind."""
    classes = [one for one in ast.walk(module) if isinstance(one, ast.ClassDef)]
    counts = {one.name: sum(isinstance(row, ast.FunctionDef) for row in one.body) for one in classes}
    return {name: count for name, count in counts.items() if count > MAX_METHODS}


def writes(module: ast.Module) -> list[str]:
    """Attributes of others that are set, counted up or deleted; ``self.other.x = 1`` is one of them."""
    stored = [
        one
        for one in ast.walk(module)
        if isinstance(one, ast.Attribute) and isinstance(one.ctx, ast.Store | ast.Del)
    ]
    return [
        ast.unparse(one) for one in stored if not (isinstance(one.value, ast.Name) and one.value.id in OWN)
    ]


def test_no_class_of_the_service_has_more_methods_than_one_keeps_in_mind() -> None:
    assert {name: large for name, module in modules() if (large := too_large(module))} == {}


def test_owners_in_the_service_are_asked_and_not_written_into() -> None:
    found = [f"{name}: {one}" for name, module in modules() for one in writes(module)]
    assert len(found) <= MAX_WRITES, found


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("def f(job):\n    job.state, job.said = 'loaded', None", ["job.state", "job.said"]),
        (
            "class A:\n    def f(self):\n        self.kept.count += 1\n        self.count = 2",
            ["self.kept.count"],
        ),
        ("def f(a):\n    del a.x\n    for a.y in (): pass\n    a.z: int = 1", ["a.x", "a.y", "a.z"]),
    ],
)
def test_writes_are_found_in_every_form(text: str, found: list[str]) -> None:
    assert sorted(writes(ast.parse(text))) == sorted(found)


def test_a_class_with_one_method_more_is_found() -> None:
    methods = "".join(f"    def f{n}(self): ...\n" for n in range(MAX_METHODS + 1))
    assert too_large(ast.parse(f"class A:\n{methods}")) == {"A": MAX_METHODS + 1}
