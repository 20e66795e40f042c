"""``directrix serve``: the service of one machine, until it is asked to end."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

from controller import journald
from controller.cli import machine_check
from controller.ipc import control_socket
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.verify.console import Refused, refusals, say, tell

NOTIFY_S = 5.0  # for systemd to make room


def serve(
    machine: str = "trunnion",
    simulate: bool = False,
    part: Path | None = None,
    state: Path | None = None,
    runtime: Path | None = None,
    period_ms: float | None = None,
    late: Literal["stop", "count"] | None = None,
    group: str = "",
    pendant: Path | None = None,
) -> None:
    """Drive a machine: drives, planner and tick, with a local socket for panel and scripts."""

    journald.use()
    with refusals(False):
        from controller.service import main
        from controller.service.pendant import read

        made = machine_file.load(machine)
        made = made if period_ms is None else machine_file.with_period(made, period_ms / 1e3)
        # Simulated drives take no harm from a computer that is busy with other work.
        made = replace(made, late=late or ("count" if simulate else made.late))
        for sentence in machine_check.warnings(made):
            tell.print(sentence)
        if part is not None:
            _see_part(part, made, simulate)
        hand = None if pendant is None else read(pendant, tuple(axis.name for axis in made.axes))
        where = (state or control_socket.state_folder(), runtime or control_socket.runtime_folder())
        key = "cli.serve.simulated" if simulate else "cli.serve.serves"
        tell.print(say(key, machine=made.name, folder=where[1]))
        try:
            main.run(made, *where, simulate, _notifier(), group, hand, part)
        except OSError as error:
            raise Refused(say("os_error_of", file=error.filename or where[0], why=error)) from error
        except control_socket.CommandRefused as error:
            raise Refused(error.sentence) from error


def _see_part(part: Path, made: Machine, simulate: bool) -> None:
    """Raises ConfigError, or Refused where nothing of it would be touched or cut."""
    from controller.runtime import simulation
    from controller.service import engine

    virtual = engine.simulated(made)
    if not simulate or simulation.bus_of(virtual, part=True) is None:
        raise Refused(say("cli.serve.no_part", part=part))
    bench = simulation.bench(part, virtual)
    if bench.cut is not None and not simulation.turns(virtual):
        raise Refused(say("cli.serve.no_load", part=part))


def _notifier() -> Callable[[str], None]:
    """To systemd where it started us, else to nobody.

    The whole protocol is a datagram to the socket that the environment names (sd_notify(3)); no package is
    needed for it, so that none can be missing: a service of Type=notify that stays silent is ended.
    """
    name = os.environ.get("NOTIFY_SOCKET", "")
    if not name:
        return lambda _: None
    address = "\0" + name[1:] if name.startswith("@") else name  # "@": in the abstract name space
    own = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    own.settimeout(NOTIFY_S)

    def tell_systemd(words: str) -> None:
        with contextlib.suppress(OSError):  # one that is lost is followed by others
            own.sendto(words.encode(), address)

    return tell_systemd
