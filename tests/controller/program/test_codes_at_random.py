"""Lines of every code with every word: refused with a place, or sound; nothing else."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest
from support.oracles import reference_interpreter
from support.suite import seed

from controller.machine.kinematics import kinematics_of
from controller.plan.path import path
from controller.plan.report import explained
from controller.program import blocks
from controller.program.code_rows import AXES, Fate
from controller.program.code_table import ROWS
from controller.program.position import homed
from controller.program.program import Program, ProgramError

NUMBERS = ("0", "1", "-2.5", "3", "10.", "0.001", "-40", "5", "2", "1.5", "90", "#1", "360")
SOUND = [row for row in ROWS if row.fate is Fate.DONE and row.name not in ("G51", "G52", "G6.2", "M2", "M30")]


def line(rng: random.Random) -> str:
    """A code with words of its own, or now and then any words."""
    if rng.random() < 0.85:
        row = rng.choice(SOUND)
        letters = sorted(set(row.letters.replace(AXES, "XYZAC")))
        words = [row.name, *(letter + rng.choice(NUMBERS) for letter in letters if rng.random() < 0.6)]
        return " ".join(words)
    words = [rng.choice(ROWS).name for _ in range(rng.choice((0, 1, 1, 2, 3)))]
    words += [
        letter + rng.choice(NUMBERS) for letter in rng.sample("XYZACRPQLKIJHFSTDUVWEB", rng.randrange(6))
    ]
    rng.shuffle(words)
    return " ".join(words)


@pytest.mark.parametrize("count", [1000, pytest.param(100_000, marks=pytest.mark.soak)])
def test_whatever_codes_say_is_refused_with_its_place_or_leads_somewhere(count: int) -> None:
    print(f"seed {seed.SEED}")
    rng, sound = random.Random(seed.SEED), 0
    for _ in range(count):
        on = replace(
            reference_interpreter.machine(rng.choice(("rs274", "fanuc"))),
            without_point=rng.choice(("unit", "thousandth", "")),
        )
        rows = ["#1=4 G21 G90 F100 S100 M3 T1 M6"] if rng.random() < 0.7 else []
        text = "\n".join([*rows, *(line(rng) for _ in range(rng.randrange(1, 9)))])
        try:
            read = Program("p.ngc", tuple(blocks.stream(text.encode(), on, "p.ngc")))
            told = list(explained.steps(read.blocks, on, "p.ngc", homed(on)))
            traced = path.trace(read, on, kinematics_of(on), homed(on))
        except ProgramError as refused:
            assert 1 <= refused.line <= max(1, len(text.splitlines())), text
            continue
        sound += 1
        ends = [told[-1].axes[axis.name] for axis in on.axes] if told else []
        for said, planned in zip(ends, on.shown(traced.end), strict=False):
            assert said is None or abs(said - planned) < 1e-6, text
    assert sound > count // 20
