"""What can be seen of a program that is refused: its path as far as it goes, and the guilty lines."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from controller.plan.report.picture import Picture, Shape
from controller.program import blocks
from controller.program.carried import InForce
from controller.program.program import Block, ProgramError
from controller.runtime import checked

MAX_DRAWN = 200_000  # blocks: the sentence of the refusal is waited for


class Lenient(checked.Task):
    """A program that is gone through though it is refused: what cannot be read is left out."""

    def read(self, in_force: InForce | None = None) -> Iterator[Block]:
        read = blocks.stream(self.text, self.machine, self.name, start=self.start, refused=[])
        return itertools.islice(read, MAX_DRAWN)


def shape_of(task: checked.Task) -> Shape | None:
    """The path after lines that cannot be read and into walls, up to where it cannot go; None of none."""
    machine = replace(task.machine, gouge="warn")
    found = Picture(task.machine, task.kinematics)
    with contextlib.suppress(Exception):  # no mistake of ours in a picture may cost the sentence
        walk = checked.path_of(Lenient(task.text, task.name, machine, task.kinematics, task.start))
        with contextlib.suppress(ProgramError):
            for _ in found.watched(walk.items):
                pass
        shape = found.shape()
        return shape if len(shape.tips) else None
    return None


def guilty_lines(refused: Mapping[str, Any], name: str) -> list[int]:
    """The lines of the program that a refusal's facts name; of a called file that which calls it."""
    places = refused.get("refusals") or [refused]
    lines = {one["line"] if one["file"] == name else one.get("called_at", 0) for one in places}
    return sorted(line for line in lines if line)
