"""Programs on the desk with what was set at a machine: ``--fitted``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from controller.machine import setup_data
from controller.machine.model import Machine
from controller.store import set_up_store
from controller.verify.console import say


def laid(machine: Machine, fitted: Path | None) -> Machine:
    """The machine with what was set at one laid over its file. Raises ConfigError."""
    return machine if fitted is None else setup_data.applied(machine, _values(fitted))


def names(fitted: Path | None) -> list[str]:
    """The names of all that does not come from the machine file."""
    return [] if fitted is None else setup_data.names(_values(fitted))


def sentence(names: list[str]) -> str:
    """The same for people; empty where all comes from the machine file."""
    return say("cli.fitted", names=", ".join(names)) if names else ""


def _values(fitted: Path) -> dict[str, Any]:
    return set_up_store.load(fitted) if fitted.is_dir() else setup_data.read(fitted)
