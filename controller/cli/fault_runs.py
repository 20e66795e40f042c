"""``directrix simulate --faults``: what is done to bus and drives in a run, and what came of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller import messages
from controller.machine.model import Machine
from controller.runtime import simulation
from controller.runtime.startup import SessionError
from controller.runtime.stepped import SteppedMachine
from controller.verify import console
from controller.verify.console import Misunderstood, Refused, in_words, say
from drives.commission import CommissionError

if TYPE_CHECKING:
    from rich.table import Table

    from controller.runtime.simulation import Injected, MachineScript, Observer

Facts = dict[str, Any]


def read(file: Path | None, origin: str, machine: Machine) -> MachineScript | None:
    """The script; None without a file. Raises Misunderstood, which ends with exit code 2."""
    if file is None:
        return None
    try:
        return simulation.script(file, machine)
    except simulation.ScriptError as error:
        why = in_words(messages.of_error(error))
        raise Misunderstood(f"{why}.") from error


class FaultRun:
    """A machine that comes up and runs under a script; without one nothing is done, or looked at."""

    def __init__(self, bench: SteppedMachine, script: MachineScript | None, origin: str) -> None:
        self._bench, self._script, self._origin = bench, script, origin
        self._injected: Injected | None = None
        self._observer: Observer | None = None

    def come_up(self) -> None:
        """Home and enable. Raises SessionError, CommissionError; under faults Refused, with their facts."""
        if self._script is None:
            self._bench.come_up()
            return
        self._observer = self._bench.observe()
        if self._origin == "home":
            self._inject(0.0)
        try:
            self._bench.come_up()
        except (SessionError, CommissionError) as error:  # the latter: a drive no longer answers
            self._bench.stand_still()
            why = in_words(messages.of_error(error))
            raise self.ended(why, result="fault", **self.facts()) from error

    def ended(self, sentence: str, **facts: Any) -> Refused:
        """A run that has ended in a fault: one that the script has planted before it was asked for."""
        if self._injected is None or not self._injected.done():
            return Refused(sentence, **facts)
        return console.ended_as_requested("fault", sentence, **facts)

    def begin(self) -> None:
        """The program begins with the next tick."""
        if self._origin == "program":
            self._inject(self._bench.machine.period_s)

    def _inject(self, after_s: float) -> None:
        if self._script is not None and self._observer is not None:
            self._observer.begin(after_s)
            self._injected = self._script.inject(self._bench.rig.buses, after_s)

    def facts(self) -> Facts:
        """For ``--json``, under "faults"."""
        if self._observer is None or self._injected is None:
            return {}
        sight = self._observer.sight
        done = [{"tick": sight.tick_at(one.time_s), **one._asdict()} for one in self._injected.done()]
        told = {"from": self._origin, "injected": done, "not_reached": self._injected.left()}
        return {"faults": {**told, **sight.to_dict()}}


def show(faults: Mapping[str, Any]) -> None:
    """For people: what was done, what was raised, how far the motors were off, when they stood."""
    console.show.print(_table(faults))
    for line in _last(faults):
        console.show.print(line)


def _table(faults: Mapping[str, Any]) -> Table:
    from rich.table import Table

    shown = Table(title=say(f"table.faults_from.{faults['from']}"))
    shown.add_column(say("table.tick"), justify="right", no_wrap=True)
    shown.add_column("s", justify="right", no_wrap=True)
    shown.add_column(say("table.what"), overflow="fold")
    for tick, time_s, what in sorted(_lines(faults), key=lambda line: line[0]):
        shown.add_row(f"{tick}", f"{time_s:.3f}", what)
    return shown


def _lines(faults: Mapping[str, Any]) -> list[tuple[int, float, str]]:
    found = [(e["tick"], e["time_s"], f"{e['line']}{_times(e['times'])}") for e in faults["injected"]]
    for one in faults["raised"]:
        key = "cli.faults.of_axis" if one["axis"] else "cli.faults.raised"
        told = {"fault": one["fault"], "axis": one["axis"], "kind": one["class"]}
        found.append((one["tick"], one["time_s"], say(key, **told)))
    return found


def _times(times: int) -> str:
    return f" ({say('cli.faults.times', times=times)})" if times > 1 else ""


def _last(faults: Mapping[str, Any]) -> list[str]:
    told = [say("cli.faults.distance")]
    for unit in ("mm", "deg"):
        its = [f"{n} {one['largest']:.3f}" for n, one in faults["distance"].items() if one["unit"] == unit]
        told.append(f"  {', '.join(its)} {say('unit.deg') if unit == 'deg' else unit}")
    if faults["stood"] is not None:
        ms = faults["stood"]["after_ms"]
        told.append(say("cli.faults.moves") if ms is None else say("cli.faults.stood", ms=ms))
    told += [say("cli.faults.not_reached", line=line) for line in faults["not_reached"]]
    return [*told, say("cli.faults.mode", mode=faults["mode"])]
