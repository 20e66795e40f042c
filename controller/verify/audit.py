"""The gouges of a whole planned program, as the check wants them: refused, or told.

Every motion is kept while the path goes by, and looked at when it has come to its end: a gouge
may be done by a block to the surface of a later one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import count
from typing import NamedTuple

from controller.machine.kinematics import Kinematics
from controller.machine.model import Machine
from controller.messages import text
from controller.motion.motions import SurfaceCut
from controller.plan.report.stored import Overcut
from controller.plan.report.verdict import Verdict
from controller.plan.stretch import Chain, Note, Pause, Stretch
from controller.program.program import Block, Place, ProgramError
from controller.verify import passes, wording
from controller.verify.gouges import Findings, Gouge, gouges, in_table
from controller.workers import Spread, here

MAX_WAYS = 20_000  # motions beside cuts that are kept: it bounds the memory


class Watched:
    """The items of a path as they go by, and what is kept of them: stretches by motion id."""

    def __init__(self, items: Iterable[Chain | Pause]) -> None:
        self._items = items
        self.stretches: dict[int, Stretch] = {}
        self.left_out = 0

    def over(self, items: Iterable[Chain | Pause]) -> Watched:
        """Itself, to watch these."""
        self._items = items
        return self

    def __iter__(self) -> Iterator[Chain | Pause]:
        number, ways = count(), 0
        for item in self._items:
            for stretch in item.stretches if isinstance(item, Chain) else ():
                k, is_cut = next(number), isinstance(stretch.motion, SurfaceCut)
                ways += not is_cut
                if is_cut or ways <= MAX_WAYS:
                    self.stretches[k] = stretch
                else:
                    self.left_out += 1
            yield item


class Audit(NamedTuple):
    """What is told of the surfaces of a path."""

    notes: list[Note]
    overcuts: list[Overcut]  # in the order of the path
    verdicts: list[Verdict]


class FormRefused(ProgramError):
    """Refused because a surface exceeds its form tolerance; gouge = "warn" allows it."""


def audit(
    watched: Watched,
    read: Callable[[], Iterable[Block]],
    name: str,
    machine: Machine,
    kinematics: Kinematics,
    progress: Callable[[float], None] = lambda _: None,
    spread: Spread = here,
) -> Audit:
    """What is told of the surfaces of a path; raises ProgramError where the machine refuses them.

    ``read`` gives the program's blocks once more, for the tools; it is not called where
    nothing could be gouged. ``progress`` gets the share of the surfaces that is looked at.
    """
    stretches = watched.stretches
    if machine.table is None and not any(isinstance(s.motion, SurfaceCut) for s in stretches.values()):
        return Audit([], [], [])
    fitted = passes.Fitted.of(read(), machine)
    findings = _found(stretches, fitted, machine, kinematics, progress, spread)
    found = findings.gouges
    places = {stretch.place.line: stretch.place for stretch in stretches.values()}
    if found and machine.gouge == "refuse":
        raise _refusal(found, places[found[0].by_line], name)
    exceeding = [one for one in findings.verdicts if not one.within]
    if exceeding and machine.gouge == "refuse":
        raise _form_refusal(findings.verdicts, places, name)
    told = [*(("Gouge", one) for one in found), *(("Overcut", one) for one in findings.ends)]
    notes = [Note(places[one.by_line], f"{what}: {one.sentence}; {one.advice}.") for what, one in told]
    notes += [Note(places[one.line], f"Form: {text(wording.exceeds(one))}.") for one in exceeding]
    if watched.left_out:
        sentence = f"{watched.left_out} motions beside surfaces were not held against them."
        notes.append(Note(Place(1, 1), sentence))
    return Audit(notes, findings.overcuts, findings.verdicts)


def _refusal(found: list[Gouge], place: Place, name: str) -> ProgramError:
    first, more = found[0], len(found) - 1
    others = f" ({more} more with --gouge warn)" if more else ""
    sentence = f'{first.sentence}; {first.advice}, or set gouge = "warn" to cut it anyway{others}'
    return ProgramError(name, place.line, place.column, sentence)


def _form_refusal(verdicts: list[Verdict], places: Mapping[int, Place], name: str) -> FormRefused:
    one, more = wording.worst(verdicts), sum(not other.within for other in verdicts) - 1
    assert one is not None
    others = f" ({more} more with --gouge warn)" if more else ""
    sentence = f'{text(wording.exceeds(one))}; or set gouge = "warn" to cut it anyway{others}'
    place = places[one.line]
    refused = FormRefused(name, place.line, place.column, sentence)
    refused.facts = {"verdict": wording.told(verdicts)}
    return refused


def _found(
    stretches: dict[int, Stretch],
    fitted: passes.Fitted,
    machine: Machine,
    kinematics: Kinematics,
    progress: Callable[[float], None],
    spread: Spread,
) -> Findings:
    """All that is told, in the order of the blocks that do it."""
    surfaces = passes.nominals(stretches, fitted)
    near = passes.planned(stretches, surfaces, fitted, kinematics, rough=True) if surfaces else {}
    found = gouges(surfaces, near, machine.max_overcut_mm, progress, spread=spread)
    if machine.table is None:
        return found
    table = in_table(machine.table, passes.rough(stretches, fitted, kinematics))
    return replace(found, gouges=sorted([*found.gouges, *table], key=lambda one: one.by_line))
