"""``directrix bus``: the bus budget of a machine, as tables, JSON or a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from controller.machine import machine_file
from controller.machine.model import Machine
from controller.runtime import drive_sheets
from controller.runtime.bus_load import budgets, overload
from controller.verify import bus_report
from controller.verify.console import Refused, answered, in_words, refusals, show
from drives.load import timeline
from drives.load.budget import BusBudget


def bus(
    file: Annotated[str | None, typer.Argument()] = None,
    machine: str = "trunnion",
    period_ms: float | None = None,
    plot: Path | None = None,
    as_json: bool = False,
) -> None:
    """The bus budget: who sends what when in a tick, at its worst; what is left, and what would fit.

    Drives that commissioning would refuse by their data sheets are refused here, too.
    """
    with refusals(as_json):
        made = machine_file.load(file or machine)
        made = made if period_ms is None else machine_file.with_period(made, period_ms / 1e3)
        found = budgets(made)
        if plot is not None:
            _draw(found, made, plot)
        if not as_json:
            for one in found:
                show.print(bus_report.bus(one, made.max_bus_share))
        facts = _facts(found, made)
        over = overload(made)
        sentences = [in_words(one) for one in (*([over] if over else ()), *drive_sheets.refusal(made))]
        if sentences:
            raise Refused("\n".join(sentences), **facts)
        answered(as_json, **facts)


def _facts(found: list[BusBudget], machine: Machine) -> dict[str, Any]:
    def of(one: BusBudget) -> dict[str, Any]:
        share = machine.max_bus_share
        return {
            **one.to_dict(),
            "fits": one.fits(share),
            "sdo_every_ticks": one.sdo_every(share),
            "timeline": [slot.to_dict() for slot in timeline.worst(one)],
        }

    return {"machine": machine.name, "max_share": machine.max_bus_share, "buses": [of(one) for one in found]}


def _draw(found: list[BusBudget], machine: Machine, path: Path) -> None:
    from controller.verify import bus_report

    bus_report.picture(found, machine.max_bus_share, machine.name, path)
