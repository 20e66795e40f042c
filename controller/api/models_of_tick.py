"""What the tick reports, and what its drives do, as OpenAPI shows it: models made of ``live_state``."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, create_model

from controller.api.answers import Texts
from controller.commands.table import SWITCHES
from controller.messages import Message
from controller.state import live_state
from controller.state.live_state import DriveRow

Fields = dict[str, Any]  # name -> type and description, as pydantic takes them

# What the service knows besides the tick, in the same objects.
_BESIDES: dict[str, Fields] = {
    "tick": {
        "period_ms": (float | None, Field(None, description="From one tick to the next.")),
        "age_s": (
            float | None,
            Field(None, description="How old this status is; of many periods: it stands."),
        ),
    },
    "feed_mm_min": {"programmed": (float | None, Field(None, description="By the program, mm/min."))},
}


def _model(name: str, fields: Fields) -> type[BaseModel]:
    return create_model(name, __config__=ConfigDict(extra="allow"), **fields)


def _of_tick() -> Fields:
    """The status' fields that are values of the snapshot, those with a dot in objects of their own."""
    found: Fields = {}
    groups: dict[str, Fields] = {}
    for field in live_state.FIELDS:
        if (shown := field.status) is not None:
            group, _, key = shown.name.rpartition(".")
            kind = str if issubclass(field.type, Enum) else field.type if shown.factor == 1.0 else float
            unit = f", {shown.unit}" if shown.unit else ""
            said = Field(
                None, description=f"{field.value.meaning[0].upper()}{field.value.meaning[1:]}{unit}."
            )
            (groups.setdefault(group, {}) if group else found)[key] = (kind | None, said)
    for group, fields in groups.items():
        model = _model(f"{group.title().replace('_', '')}Facts", fields | _BESIDES.get(group, {}))
        found[group] = (model | None, None)
    switches = {one.name: (bool | None, Field(None, description=one.state)) for one in SWITCHES}
    return found | switches


def _of_drives() -> Fields:
    hints = get_type_hints(DriveRow, include_extras=True)
    declared = {name: get_args(hints[name]) for name in DriveRow._fields}
    shown = {name: Texts if kind == Message | None else kind for name, (kind, _) in declared.items()}
    return {name: (shown[name] | None, Field(None, description=told)) for name, (_, told) in declared.items()}


if TYPE_CHECKING:

    class OfTick(BaseModel):
        """What of the status is a value of the snapshot; null: not known."""

    class DriveFacts(BaseModel):
        """One drive, as the service hears it on the bus; null: not known."""

else:
    OfTick = _model("OfTick", _of_tick())
    DriveFacts = _model("DriveFacts", _of_drives())
