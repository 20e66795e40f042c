"""The position that the reader follows: asked at every line or only at the end, it is the same."""

from __future__ import annotations

import random

from support.oracles import reference_interpreter
from support.parts import random_codes
from support.suite import seed

from controller.program import blocks, position
from controller.program.position import Position, homed


def test_what_is_not_asked_on_the_way_is_known_at_the_end() -> None:
    print(f"seed {seed.SEED}")
    rng, on = random.Random(seed.SEED), reference_interpreter.machine()
    for _ in range(60):
        often, once = Position(on, homed(on)), Position(on, homed(on))
        for block in blocks.stream(random_codes.program(rng).encode(), on, "p.ngc"):
            often.take(block)
            often.joints()
            once.take(block)
        assert all(
            a is not None and b is not None and abs(a - b) < 1e-9
            for a, b in zip(often.joints(), once.joints(), strict=True)
        )


def test_a_long_program_is_not_held() -> None:
    on = reference_interpreter.machine()
    here = Position(on, homed(on))
    text = "G1 F100 X1 Y2\n" + "X5\nX6\n" * position.MAX_PENDING
    for block in blocks.stream(text.encode(), on, "p.ngc"):
        here.take(block)
    assert len(here._pending) <= position.MAX_PENDING + 1
    assert here.joints()[:2] == (6.0, 2.0)
