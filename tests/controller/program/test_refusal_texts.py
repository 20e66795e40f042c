"""Every refusal of the reader is a text of the catalogue, in every language."""

from __future__ import annotations

import ast
import random
import re
from pathlib import Path

import pytest
from support.machines.shipped_kinds import machine
from support.suite import seed

from controller import program
from controller.messages import LANGUAGES, Message, text
from controller.program import code_table, codes, refusals
from controller.program.code_rows import Fate

TREES = {
    file.name: ast.parse(file.read_text()) for file in sorted(Path(program.__file__).parent.rglob("*.py"))
}
KEYED = {"refusal": 1, "_wrong": 1, "said": 0, "Key": 0, "NoValue": 0, "NoCircleError": 0}  # place of the key


def keys() -> set[str]:
    """All texts of the room that look like keys of its catalogue."""
    topics = {key.split(".")[0] for key in LANGUAGES["en"].texts if "." in key}
    key = re.compile(rf"({'|'.join(topics)})\.[\w.]+")
    nodes = (node for tree in TREES.values() for node in ast.walk(tree))
    written = (node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str))
    return {one for one in written if key.fullmatch(one)}


def arguments() -> list[tuple[str, ast.expr]]:
    """Where a key is due: what stands there, and where that is."""
    found = []
    for file, tree in TREES.items():
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call):
                continue
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in KEYED and len(node.args) > KEYED[name]:
                found.append((f"{file}:{node.lineno}", node.args[KEYED[name]]))
    return found


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_key_of_the_room_has_its_text(language: str) -> None:
    assert len(keys()) > 250
    assert sorted(keys() - LANGUAGES[language].texts.keys()) == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_code_that_is_refused_is_said_with_what_to_write(language: str) -> None:
    rows = [row for row in code_table.ROWS if row.fate is Fate.REFUSED or row.only]
    said = [row.refused_with() for row in rows]
    keys = {key for one in said for key in (one["meaning"], one["instead"])}
    assert len(keys) == 2 * len(rows) > 80
    keys |= {codes._named(row) for row in code_table.ROWS if row.group not in ("", row.name)}
    assert sorted(keys - LANGUAGES[language].texts.keys()) == []


def test_no_refusal_is_made_of_a_sentence() -> None:
    """Neither written where it is raised, nor put together there."""
    assert len(arguments()) > 250
    written = [
        where
        for where, key in arguments()
        if isinstance(key, ast.JoinedStr | ast.BinOp)
        or (isinstance(key, ast.Constant) and " " in str(key.value))
    ]
    assert written == []


def used(said: Message) -> set[str]:
    """The keys of a text and of those among its values."""
    inner = [
        one for value in said["values"].values() for one in (value if isinstance(value, list) else [value])
    ]
    return {said["key"]}.union(*(used(one) for one in inner if isinstance(one, dict)))


ROWS = (
    "G0 G1 G2 G3 G4 G5 G5.1 G5.2 G5.3 G6.2 G10 G17 G18 G20 G28 G30 G33 G33.1 G38.2 G40 G41 G42",
    "G41.1 G43 G43.1 G43.4 G43.5 G49 G51 G52 G53 G53.1 G54.1 G61 G64 G68 G68.2 G68.3 G68.4 G69",
    "G73 G76 G80 G81 G83 G84 G86 G87 G90 G91 G92 G93 G94 G95 G98 G99 G99.9 G7 G16 M3 M5 M6 M19",
    "M61 M62 M66 M67 M72 M97 M98 M99 X1 X1O Y2 Z-3 A4 B5 C6 I1 J2 K3 R4 R-1 P0 P1 P9 Q0 Q2 Q-1",
    "L2 L20 L99 D1 D9 H1 H7 T1 T9 S100 F100 F0 E1 N5 U1 @5 ^30 #<a> X#<a> X[1/0] X[1 X1..5 #1=2",
    "#5221=1 ( % o1 o1sub o1endsub o1call o1if[1] o1endif X#5399",
)
WORDS = [word for row in ROWS for word in row.split()]


def soup(rng: random.Random) -> bytes:
    lines = ("".join(rng.choices(WORDS, k=rng.randint(1, 5))) for _ in range(rng.randint(1, 12)))
    return "\n".join(lines).encode()


@pytest.mark.parametrize("dialect", ["rs274", "fanuc"])
def test_what_is_refused_can_be_said_in_every_language(dialect: str) -> None:
    print(f"seed {seed.SEED}")
    rng, met = random.Random(seed.SEED), set[str]()
    on = [machine("fig4a", dialect=dialect), machine("fig4a", dialect=dialect)]
    for _ in range(300):
        for one in refusals.of(soup(rng), rng.choice(on), "p"):
            met |= used(one.said)
            for language, catalogue in LANGUAGES.items():
                assert used(one.said) <= catalogue.texts.keys()
                told = text(one.said, language)
                assert "{" not in told and not told.startswith(one.said["key"]), (one.said, told)
    assert len(met) > 60 and "text" not in met, met
