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
from controller.messages import Message, message
from controller.motion.motions import SurfaceCut
from controller.plan.report.stored import Overcut
from controller.plan.report.verdict import Verdict
from controller.plan.segment import Note, PathItem, Segment
from controller.program.program import Block, Place, ProgramError
from controller.verify import passes, wording
from controller.verify.gouges import Findings, Gouge, gouges, in_table
from controller.workers import Spread, here

MAX_WAYS = 20_000  # motions beside cuts that are kept: it bounds the memory


class Watched:
    """The items of a path as they go by, and what is kept of them: segments by motion id."""

    def __init__(self, items: Iterable[PathItem]) -> None:
        self._items = items
        self.segments: dict[int, Segment] = {}
        self.left_out = 0

    def over(self, items: Iterable[PathItem]) -> Watched:
        """Itself, to watch these."""
        self._items = items
        return self

    def __iter__(self) -> Iterator[PathItem]:
        number, ways = count(), 0
        for item in self._items:
            for segment in item.segments:
                k, is_cut = next(number), isinstance(segment.motion, SurfaceCut)
                ways += not is_cut
                if is_cut or ways <= MAX_WAYS:
                    self.segments[k] = segment
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
    """What is reported of the surfaces of a path; raises ProgramError where the machine refuses them.

    ``read`` gives the program's blocks once more, for the tools; it is not called where
    nothing could be gouged. ``progress`` gets the share of the surfaces that is looked at.
    """
    segments = watched.segments
    if machine.table is None and not any(isinstance(s.motion, SurfaceCut) for s in segments.values()):
        return Audit([], [], [])
    fitted = passes.Fitted.of(read(), machine)
    findings = findings_of(segments, fitted, machine, kinematics, progress, spread)
    found = findings.gouges
    places = _places(segments.values())
    if found and machine.gouge == "refuse":
        raise _refusal(found, _place(places, found[0].by_line), name)
    exceeding = [one for one in findings.verdicts if not one.within]
    if exceeding and machine.gouge == "refuse":
        raise _form_refusal(findings.verdicts, places, name)
    notes = [Note(_place(places, one.by_line), one.with_advice("gouge.told")) for one in found]
    notes += [
        Note(_place(places, one.by_line), one.with_advice("gouge.overcut_told")) for one in findings.ends
    ]
    told = [(one.line, message("form.told", sentence=wording.exceeds(one))) for one in exceeding]
    notes += [Note(places[line], sentence) for line, sentence in told]
    if watched.left_out:
        notes.append(Note(Place(1, 1), message("note.left_out", count=watched.left_out)))
    return Audit(notes, findings.overcuts, findings.verdicts)


def _places(segments: Iterable[Segment]) -> dict[int, Place]:
    """By lines of the program; one that calls a file with several of them stands for itself."""
    found: dict[int, Place] = {}
    for place in (segment.place for segment in segments):
        known = found.setdefault(place.line, place)
        if known.file_line != place.file_line:
            found[place.line] = Place(place.line, 1)
    return found


def _place(places: Mapping[int, Place], line: int) -> Place:
    """That of a line; one of many in a motion has no block of its own."""
    return places.get(line) or Place(line, 1)


def _refusal(found: list[Gouge], place: Place, name: str) -> ProgramError:
    why = found[0].with_advice("gouge.refused", more=_more(len(found) - 1))
    return place.refusal(name, why)


def _more(count: int) -> Message | str:
    """How many others there are."""
    return message("gouge.more", more=count) if count else ""


def _form_refusal(verdicts: list[Verdict], places: Mapping[int, Place], name: str) -> ProgramError:
    one, more = wording.worst(verdicts), sum(not other.within for other in verdicts) - 1
    assert one is not None
    why = message("form.refused", sentence=wording.exceeds(one), more=_more(more))
    refused = places[one.line].refusal(name, why, FormRefused)
    refused.facts = {"verdict": wording.to_json(verdicts)}
    return refused


def findings_of(
    segments: dict[int, Segment],
    fitted: passes.Fitted,
    machine: Machine,
    kinematics: Kinematics,
    progress: Callable[[float], None] = lambda _: None,
    spread: Spread = here,
) -> Findings:
    """Gouges and verdicts on the surfaces of a planned path, in the order of the blocks that make them.

    It is the one judgement of a plan: ``check``, ``verify`` and ``fit`` report what it finds.
    """
    surfaces = passes.nominals(segments, fitted)
    near = passes.planned(segments, surfaces, fitted, kinematics, rough=True) if surfaces else {}
    found = gouges(surfaces, near, machine.max_overcut_mm, progress, spread=spread)
    if machine.table is None:
        return found
    table = in_table(machine.table, passes.rough(segments, fitted, kinematics))
    return replace(found, gouges=sorted([*found.gouges, *table], key=lambda one: one.by_line))
