"""Every kind of step once on a machine that runs, by its panel; its operator's hands are at the terminals."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.live import shop
from support.live.terminals import Terminals

from controller.bringup import conduct, excitation, machinery
from controller.bringup import protocol as protocols
from controller.bringup.conduct import carry_out
from controller.bringup.simulated import SPHERE, over_sphere
from controller.bringup.site import Site
from controller.bringup.steps import KINDS, Step, steps
from controller.calibration import rotary_fit
from controller.cli import remote
from controller.cli.live_bench import LiveBench
from controller.machine import machine_file
from controller.machine.model import TOOL_AT_POWER_ON
from controller.messages import Message, text
from controller.state.modes import Mode

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]
PART = "G21 G90 G54 G94\nT1 M6\nS3000 M3\nG1 X10 Y5 F1500\nX0 Y0\nM30\n"
ABOVE_MM = 1.5  # of the sphere, where the operator has jogged the probe
OF = ("X", "XY", "A", "Z", "")  # one step of each kind: of the first of these that it has


class Hands:
    """An operator who does what he is asked for."""

    def __init__(self, terminals: Terminals, step: Step, bench: LiveBench) -> None:
        self._at, self._step, self._bench = terminals, step, bench

    def value(self, question: Message) -> float:
        return 12.5 if question["key"] == "bringup.ask.sphere" else 10.0

    def confirms(self, question: Message) -> bool:
        return True

    def does(self, request: Message) -> None:
        key = request["key"]
        if key == "bringup.hand.release":
            self._press()
        elif key == "bringup.hand.sphere":
            self._bench.run(over_sphere(self._bench.machine, ABOVE_MM), "over_sphere")

    @contextlib.contextmanager
    def works(self, request: Message) -> Iterator[Callable[[], bool]]:
        if request["key"] in ("bringup.hand.work", "bringup.hand.back"):
            what = request["values"]["what"]
            if self._step.kind == "inputs":
                self._at.turn_input(what)
            else:
                self._at.turn_switch(self._step.of, what["key"].rpartition(".")[2])
        else:
            self._press()
        yield lambda: False

    def _press(self) -> None:
        if self._step.kind == "estop":
            self._at.turn_input("estop")
        else:
            self._at.turn_sto(self._step.of)


def shortened(patch: pytest.MonkeyPatch) -> None:
    """As much of each step as shows that it is done; what comes of all of it is seen on a stepped clock."""
    patch.setattr(machinery, "POSITIONS", rotary_fit.FEWEST_POSITIONS)
    patch.setattr(machinery, "CLEAR_MM", 2.0)
    patch.setattr(conduct, "SHARES", (excitation.SHARES[-1],))
    patch.setattr(excitation, "STROKES", 15)
    patch.setattr(conduct, "RADIUS_MM", 4.0)


def two_tools() -> str:
    """The shop with two tools in its magazine beside the probe."""
    text, full = shop.text_of("shop"), "pockets = [1, 2, 3, 4, 0, 0, 0, 99]"
    assert full in text
    return text.replace(full, "pockets = [1, 2, 0, 0, 0, 0, 0, 99]")


def test_every_kind_of_step_is_done_on_a_machine_that_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shortened(monkeypatch)
    folder, part = tmp_path / "machine", tmp_path / "part.ngc"
    folder.mkdir()
    part.write_text(PART)
    with shop.opened(folder, machine=two_tools(), part=SPHERE) as running:
        running.up()
        running.do("POST", "/changer/confirm", json={"spindle": TOOL_AT_POWER_ON, "clear": True})
        running.ready()
        running.http.delete("/control")
        machine = machine_file.load(str(running.machine_file))
        terminals = Terminals(machine)
        protocol = protocols.opened(tmp_path / "protocol", machine, simulated=False)
        with remote.connected(running.url, "") as found, contextlib.closing(terminals):
            bench = LiveBench(found, machine)
            with found.control():
                for step in chosen(steps(machine)):
                    why = carry_out(step, Site(bench, Hands(terminals, step, bench), protocol, part))
                    assert why is None, (step.name, text(why))
                    done = protocol.done[step.name]
                    # The simulated axes are soft in their answer, which is told; all else is as it should be.
                    told = [text(one) for one in done["findings"]]
                    assert done["verdict"] == "good" or step.kind == "response", (step.name, told)
                    assert running.status()["mode"] == Mode.READY.name, step.name
        assert {one.partition(".")[0] for one in protocol.done} == {kind.name for kind in KINDS}


def chosen(every: list[Step]) -> list[Step]:
    """One of each kind."""
    found: dict[str, Step] = {}
    for of in OF:
        for step in every:
            if step.of == of:
                found.setdefault(step.kind, step)
    order = [kind.name for kind in KINDS]
    return sorted(found.values(), key=lambda step: order.index(step.kind))
