"""The protocol of a bring-up: a folder with what came of each step, sealed, and the report made of it.

It can be left after any step and gone on with: what was done stays. A step that is done again takes the place
of what it came to before.
"""

from __future__ import annotations

import hashlib
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from controller import sealed_file
from controller.machine.model import Machine
from controller.messages import Message, TextError, message

FILE = "bring_up.json"
FOLDER = "bring_up"  # of the panel's folder: the protocol that the page goes on with
REPORT = "bring_up.html"
GOOD, BAD, SKIPPED = "good", "bad", "skipped"


class NoProtocol(TextError, ValueError):
    """A folder's protocol is damaged, or of something else."""


@dataclass
class Outcome:
    """What came of a step: whether it is as it should be, what was measured, told and proposed, pictures.

    ``proposals`` are those of ``proposals.Proposal``, ``charts`` those of ``charts``, as JSON.
    """

    good: bool
    figures: list[Message] = field(default_factory=list)
    findings: list[Message] = field(default_factory=list)
    proposals: list[dict[str, Any]] = field(default_factory=list)
    charts: list[dict[str, Any]] = field(default_factory=list)
    measured: dict[str, float] = field(default_factory=dict)  # by name: what other steps and scripts read


@dataclass
class Protocol:
    """Of one machine, simulated or not; ``done`` by name of the step."""

    folder: Path
    machine: str
    simulated: bool
    machine_sha256: str
    done: dict[str, dict[str, Any]]

    def note(self, step: str, outcome: Outcome) -> None:
        """Keeps it on the disk. Raises OSError."""
        self._keep(step, GOOD if outcome.good else BAD, outcome)

    def skip(self, step: str, reason: str) -> None:
        """A step that is not done on this machine, and why; kept likewise. Raises OSError."""
        self._keep(step, SKIPPED, Outcome(False, findings=[message("bringup.skipped", reason=reason)]))

    def _keep(self, step: str, verdict: str, outcome: Outcome) -> None:
        row = {
            "verdict": verdict,
            "at_s": time.time(),
            "machine_sha256": self.machine_sha256,
            **{name: getattr(outcome, name) for name in Outcome.__dataclass_fields__ if name != "good"},
        }
        self.done[step] = row
        values = {"machine": self.machine, "simulated": self.simulated, "done": self.done}
        sealed_file.write(self.folder / FILE, values)

    def is_of_another_file(self, step: str) -> bool:
        """Whether the machine file has changed since a step was done."""
        return bool(self.done[step]["machine_sha256"] != self.machine_sha256)

    def measured(self, kind: str, name: str) -> dict[str, float]:
        """One value of the steps of a kind that were done with this machine file, by what they are of."""
        found = {}
        for step, row in self.done.items():
            of_kind, _, of = step.partition(".")
            if of_kind == kind and name in row["measured"] and not self.is_of_another_file(step):
                found[of] = float(row["measured"][name])
        return found


def opened(folder: Path, machine: Machine, simulated: bool) -> Protocol:
    """That of a folder, or a new one. Raises NoProtocol, OSError."""
    made = Protocol(folder, machine.name, simulated, hashlib.sha256(machine.text.encode()).hexdigest(), {})
    try:
        found = sealed_file.read(folder / FILE)
        if not sealed_file.is_sealed(folder / FILE):
            raise sealed_file.Damaged(message("sealed.none"))
    except FileNotFoundError:
        return made
    except sealed_file.Damaged as error:
        raise NoProtocol(message("bringup.damaged", file=folder / FILE, why=error.said)) from error
    if (found["machine"], found["simulated"]) != (machine.name, simulated):
        kinds = {True: message("bringup.simulated"), False: message("bringup.real")}
        raise NoProtocol(
            message(
                "bringup.other",
                folder=folder,
                found=found["machine"],
                found_kind=kinds[bool(found["simulated"])],
                machine=machine.name,
                kind=kinds[simulated],
            )
        )
    made.done = found["done"]
    return made
