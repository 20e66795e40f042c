"""``directrix drives stop``: quick stop and NMT stop for every drive, without a running controller."""

from __future__ import annotations

import typer

from controller import messages
from controller.cli import speech
from controller.machine import machine_file, nodes
from controller.machine.model import Machine
from controller.verify.console import Refused, answered, in_words, refusals, say, show
from drives import bus as buses
from drives import commission, pdo, quick_stop
from drives.settings import BusSettings


def stop(machine: str = "trunnion", as_json: bool = False) -> None:
    """Quick stop for every drive, then NMT stop: for the end of a service, whatever it ended of.

    It asks nobody and refuses nothing: a stop is always allowed. It is no emergency stop.
    """
    with refusals(as_json):
        made = machine_file.load(machine)
        told, silent, unreachable = [], [], []
        for settings in nodes.bus_settings(made):
            if settings.interface in ("virtual", "shared"):
                continue  # simulated drives end with their hub
            try:
                silent += _stopped(made, settings)
                told.append(settings.name)
            except buses.BusError as error:
                unreachable.append(in_words(messages.of_error(error)))
        _report(as_json, told, silent, unreachable)


def _stopped(machine: Machine, settings: BusSettings) -> list[str]:
    """The drives of one bus that did not confirm. Raises BusError."""
    port = buses.open(settings, pdo.SERVICE_FILTERS)
    try:
        its = [node for node in nodes.all_settings(machine) if node.bus == settings.name]
        return quick_stop.stop(port, its, commission.wall_pump(port.fileno()))
    finally:
        port.close()


def _report(as_json: bool, told: list[str], silent: list[str], unreachable: list[str]) -> None:
    """Raises Refused where somebody may not have heard."""
    facts = {"told": told, "silent": silent}
    sentences = list(unreachable)
    if silent:
        sentences.append(say("cli.stop.silent", names=", ".join(silent)))
    if sentences:
        raise Refused("\n".join(sentences), **facts)
    if not answered(as_json, **facts):
        show.print(say("cli.stop.told", names=", ".join(told)) if told else say("cli.stop.none"))


if __name__ == "__main__":  # at the end of a service: in a third of the time of the whole command line
    typer.run(speech.speaking(stop))
