"""What a line changes for good: beyond its program, and a loss of power."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from controller.machine.changes import Change, Shifted
from controller.machine.model import KEPT_OFFSETS
from controller.program.modal import State

K = TypeVar("K")


def between(before: State, after: State) -> tuple[Change, ...]:
    """From the state before a line to the one after it."""
    if before is after:
        return ()
    old, new = before.origins, after.origins
    made: list[Change] = []
    if new.written is not old.written:
        made += [Change("offsets", KEPT_OFFSETS[i], new.written[i]) for i in _fresh(old.written, new.written)]
    if (new.shift, new.suspended) != (old.shift, old.suspended):
        made.append(Change("shift", "G92", Shifted(new.shift, new.suspended)))
    if after.tools is not before.tools:
        made += [Change("tools", str(n), after.tools[n]) for n in _fresh(before.tools, after.tools)]
    if after.references is not before.references:
        made += [
            Change("references", code, tuple([q or 0.0 for q in after.references[code]]))
            for code in _fresh(before.references, after.references)
        ]
    return tuple(made)


def of_parameters(values: Mapping[int, float]) -> tuple[Change, ...]:
    return tuple(Change("parameters", str(number), value) for number, value in values.items())


def _fresh(before: Mapping[K, Any], after: Mapping[K, Any]) -> list[K]:
    """The keys whose values are new; one that is set to what it was is set, too."""
    return [key for key, value in after.items() if before.get(key) is not value]
