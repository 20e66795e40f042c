"""Text that nobody meant: refused with its place, or read; never anything else."""

from __future__ import annotations

import random
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest
from support.oracles import reference_interpreter
from support.suite import seed

from controller.machine import machine_file
from controller.program import blocks, refusals
from controller.program.code_table import ROWS
from controller.program.program import ProgramError

SHIPPED = sorted((machine_file.SHIPPED / "programs").glob("*.ngc"))
FRAGMENTS = (
    "o1 sub|o1 endsub|o1 call [1]|o<a> call|o2 if [#1 gt 1]|o2 else|o2 elseif [1]|o2 endif|"
    "o3 while [#1 lt 3]|o3 endwhile|o4 do|o4 while [0]|o5 repeat [2]|o5 endrepeat|o5 break|o5 continue|"
    "WHILE [#1 LT 3] DO1|END1|DO2|END2|GOTO 10|N10|IF [#1 GT 1] GOTO 10|IF [1] THEN #1=2|GOTO #1|IF [#1]|"
    "o1 return [1]|M98 P1 L3|M99|O1|#1=[#1+1]|#<_a>=2|#<b>|##1|exists[#<a>]|(msg, a)|(debug,%d#<b>)|%|"
    "/1|N1.5|X1O|E5|1e5|--3|+-2|"
    "[|]|[[2]|2**-1|atan[1]/[0]|sqrt[-1]|1/0|.|-|G|Xx|\x00|\x1a|\x11|\x13|\r|;|(|)|((|é|\ufeff|\u2028"
)


def texts(rng: random.Random) -> Iterator[str]:
    """Fragments of the language put together, or a sound program with bytes changed."""
    sound = [path.read_text() for path in SHIPPED]
    codes = [row.name for row in ROWS]
    while True:
        if rng.random() < 0.3:
            yield _hurt(rng, rng.choice(sound))
            continue
        rows = (_line(rng, codes) for _ in range(rng.randrange(1, 12)))
        yield rng.choice(("\n", "\r\n", "\r")).join(rows)


def _line(rng: random.Random, codes: list[str]) -> str:
    words = []
    for _ in range(rng.randrange(1, 6)):
        letter = rng.choice("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
        number = rng.choice(
            ("0", "1", "-2.5", "999999999", ".", "1.2.3", "#1", "[1+2]", "-0", "1e9", "0.0001")
        )
        words.append(rng.choice((rng.choice(codes), rng.choice(FRAGMENTS.split("|")), letter + number)))
    return rng.choice(("", " ")).join(words)


def _hurt(rng: random.Random, text: str) -> str:
    found = list(text)
    for _ in range(rng.randrange(1, 6)):
        at = rng.randrange(len(found))
        found[at : at + rng.randrange(3)] = rng.choice((chr(rng.randrange(256)), "", found[at] * 3, "\n"))
    return "".join(found)


@pytest.mark.parametrize("lines", [10_000, pytest.param(1_000_000, marks=pytest.mark.soak)])
def test_nothing_that_is_written_ends_in_anything_but_a_refusal_with_its_place(lines: int) -> None:
    print(f"seed {seed.SEED}")
    rng, seen, worst, refused = random.Random(seed.SEED), 0, 0.0, 0
    machines = [
        replace(reference_interpreter.machine(dialect), program_passes=300) for dialect in ("rs274", "fanuc")
    ]
    for text in texts(rng):
        data, on, begun = text.encode("latin-1", "replace"), rng.choice(machines), time.process_time()
        count = 1 + sum(text.count(end) for end in "\n\r")
        try:
            for _ in blocks.stream(data, on, "p.ngc"):
                pass
        except ProgramError as error:
            refused += 1
            assert error.sentence and 1 <= error.line <= count, text
        refusals.of(data, on, "p.ngc")
        worst, seen = max(worst, time.process_time() - begun), seen + count
        if seen >= lines:
            break
    print(f"{seen} lines, {refused} texts refused, the slowest text took {worst:.3f} s of processor time")
    assert refused
