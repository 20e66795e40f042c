"""Machine files with a mistake each, and the line and the key for which they are refused."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from pathlib import Path

from support.net import runs

from controller.machine import machine_file
from controller.machine.toml_table import ConfigError

COUNT = 240
KEY = re.compile(r"^(\w+) = (.*)$")
OF = re.compile(r"^[^:]*:(?P<line>\d+): (?P<table>[^:]*): (?P<key>\w+)")
SITES = re.compile(r"^[^:]*: ?(?P<where>[^:]*)")


def texts(folder: Path) -> list[str]:
    """Of a trunnion, of a machine with all that there may be, and of a drawn one."""
    known = runs.inputs(folder)
    wanted = ("trunnion", "machining_centre", "machining_centre-drawn")
    return [next(one.machine for one in known.values() if one.name.endswith(f" {name}")) for name in wanted]


def mistakes(text: str) -> Iterator[tuple[str, str]]:
    """(what is wrong, the text with it), of every key."""
    lines = text.splitlines()
    for k, line in enumerate(lines):
        found = KEY.match(line)
        if found is None:
            continue
        key, value = found.groups()
        wrong = {
            "left out": None,
            "misspelt": f"{key}x = {value}",
            "twice": f"{line}\n{line}",
            "a text": f'{key} = "nonsense"',
            "a number": f"{key} = -1e12",
            "nothing": f"{key} = []",
        }
        for what, instead in wrong.items():
            made = [*lines[:k], *([] if instead is None else [instead]), *lines[k + 1 :]]
            yield f"line {k + 1} {key} {what}", "\n".join(made)


def text(folder: Path) -> str:
    """Line and key of each refusal; of what is no TOML the line alone."""
    rows = []
    for number, one in enumerate(texts(folder)):
        every = list(mistakes(one))
        for what, wrong in random.Random(f"mistakes {number}").sample(every, COUNT // 3):
            rows.append(f"file {number} {what} = {refusal(wrong)}\n")
    return "".join(rows)


def refusal(wrong: str) -> str:
    try:
        machine_file.read(wrong, "machine.toml")
    except ConfigError as error:
        sentence = str(error)
        if found := OF.match(sentence):
            return f"{found['line']} {found['table']} {found['key']}"
        place = re.match(r"[^:]*:(\d+):\d+: ", sentence)
        return f"{place[1]} not TOML" if place else str(SITES.match(sentence) and sentence.split(";")[0])
    return "accepted"
