"""``directrix serve``: the service of one machine, until it is told to end."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from controller import config, door
from controller.session.startup import SessionError
from controller.toml_table import ConfigError
from controller.verify.console import Refused, refusals, tell

MachineFile = Annotated[str, typer.Option("--machine", help="Machine file, or the name of a shipped one.")]


def serve(
    machine: MachineFile = "trunnion",
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Virtual buses with simulated drives.")
    ] = False,
    state: Annotated[
        Path | None, typer.Option("--state", help="Folder of what is kept; default: systemd's or the user's.")
    ] = None,
    runtime: Annotated[
        Path | None, typer.Option("--runtime", help="Folder of the socket; default: systemd's or the user's.")
    ] = None,
    group: Annotated[str, typer.Option("--group", help="Whose members may use the socket, too.")] = "",
) -> None:
    """Drive a machine: drives, planner and tick, with a local socket for panel and scripts."""
    from drives.bus import BusError

    with refusals(False, lambda: (ConfigError, SessionError, BusError)):
        from controller.service import serving

        made = config.load(machine)
        for sentence in config.warnings(made):
            tell.print(sentence, markup=False)
        where = (state or door.state_folder(), runtime or door.runtime_folder())
        tell.print(f"{made.name}: {'simulated, ' if simulate else ''}socket in {where[1]}", markup=False)
        try:
            serving.run(made, *where, simulate, _notifier(), group)
        except OSError as error:
            raise Refused(f"{error.filename or where[0]}: {error.strerror or error}.") from error
        except door.DoorError as error:
            raise Refused(error.sentence) from error


def _notifier() -> Callable[[str], None]:
    """To systemd where it started us, else to nobody."""
    try:
        import sdnotify
    except ModuleNotFoundError:
        return lambda _: None
    notifier = sdnotify.SystemdNotifier()

    def tell_systemd(words: str) -> None:
        notifier.notify(words)

    return tell_systemd
