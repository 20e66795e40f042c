"""``directrix backup``: machine file, offsets, tools, settings and programs as one checked archive."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from controller.api import backup
from controller.api.backup import Contents
from controller.api.store import Store
from controller.cli import installation, machine_check
from controller.cli.speech import Verbs
from controller.ipc import control_socket
from controller.machine import machine_file as config
from controller.machine import setup_data
from controller.machine.model import Machine
from controller.runtime.bus_load import overload
from controller.verify.console import Refused, answered, in_words, refusals, say, show

app = Verbs(add_completion=False, no_args_is_help=True)

Target = Annotated[Path | None, typer.Option("--machine")]


@app.command()
def save(archive: Path, machine: str = "", state: Path | None = None, as_json: bool = False) -> None:
    """Write one archive of everything that is set and stored; also while the machine runs."""
    with refusals(as_json):
        store = Store(state or control_socket.state_folder())
        backup.save(store, _machine(store, machine), archive)
        _show(as_json, {"archive": str(archive), **_facts(backup.check(archive))})


@app.command()
def check(archive: Path, as_json: bool = False) -> None:
    """Read an archive whole and say what is in it; nothing is changed."""
    with refusals(as_json):
        _show(as_json, {"archive": str(archive), **_facts(backup.check(archive))})


@app.command()
def restore(
    archive: Path,
    machine_file: Target = None,
    state: Path | None = None,
    runtime: Path | None = None,
    as_json: bool = False,
) -> None:
    """Put everything of an archive back; what was is kept, for rollback. The service must not run."""
    with refusals(as_json):
        store = Store(state or control_socket.state_folder())
        _at_rest(store, runtime)
        contents = backup.check(archive)
        if machine_file is not None:
            _sound(contents.machine, as_json)
        _restored(store, contents, machine_file, as_json)


@app.command()
def update(
    new: Path,
    machine_file: Annotated[Path, typer.Option("--machine")],
    state: Path | None = None,
    runtime: Path | None = None,
    as_json: bool = False,
) -> None:
    """Replace the machine file, checked with the tools and offsets in use; the old one is kept."""
    with refusals(as_json):
        store = Store(state or control_socket.state_folder())
        _at_rest(store, runtime)
        _sound(config.load(new), as_json)
        _show(as_json, {"done": backup.update(store, new, machine_file)})


@app.command()
def rollback(
    machine_file: Target = None, state: Path | None = None, runtime: Path | None = None, as_json: bool = False
) -> None:
    """Undo the last restore or update; done twice, it is as before.

    The machine file, where that replaced it, goes to --machine, or to where the installed service reads it.
    """
    with refusals(as_json):
        store = Store(state or control_socket.state_folder())
        _at_rest(store, runtime)
        if not (kept := backup.automatic_backups(store)):
            raise Refused(say("cli.backup.nothing", folder=store.folder))
        contents = backup.check(kept[0])
        target = machine_file or installation.machine_file_of(store.folder)
        if contents.machine_file is not None and target is None:
            raise Refused(
                say("cli.backup.where_machine", archive=kept[0], machine_file=contents.machine_file)
            )
        _restored(store, contents, target if contents.machine_file is not None else None, as_json)


def _sound(machine: Machine, quiet: bool) -> None:
    """Raises Refused for what ``check``, ``bus`` and commissioning refuse: no service would start with it.

    A roll-back does not ask: what was in use before is taken as it was.
    """
    machine_check.sheets(machine, quiet)
    if why := overload(machine):
        raise Refused(in_words(why))


def _restored(store: Store, contents: Contents, machine_file: Path | None, as_json: bool) -> None:
    before = config.load(machine_file) if machine_file and machine_file.exists() else _noted(store)
    _show(as_json, {"done": backup.restore(store, contents, machine_file, before)})


def _machine(store: Store, named: str) -> Machine:
    if named:
        return config.load(named)
    if (noted := _noted(store)) is None:
        raise Refused(say("cli.backup.no_machine", folder=store.folder))
    return noted


def _noted(store: Store) -> Machine | None:
    """The service's machine, as its builder wrote it."""
    try:
        return setup_data.noted(store.folder)
    except (OSError, ValueError):
        return None


def _at_rest(store: Store, runtime: Path | None) -> None:
    """Raises Refused while the store's service runs, or hangs: it would write over what is put back."""
    socket = control_socket.control_path(runtime or control_socket.runtime_of(store.folder))
    if control_socket.is_served(socket):
        raise Refused(say("cli.backup.service_runs", folder=store.folder, socket=socket))


def _facts(contents: Contents) -> dict[str, Any]:
    return {
        "machine": contents.machine.name,
        "made": time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(contents.made_s)),
        "offsets": len(contents.fitted.get("offsets") or {}),
        "tools": len(contents.fitted.get("tools") or {}),
        "settings": len(contents.settings),
        "programs": len(contents.programs),
    }


def _show(as_json: bool, facts: dict[str, Any]) -> None:
    done = [in_words(one) for one in facts.get("done") or ()]
    if answered(as_json, **{**facts, **({"done": done} if done else {})}):
        return
    listed = (say(f"cli.backup.fact.{name}", value=value) for name, value in facts.items() if name != "done")
    show.print("\n".join(done or [f"{', '.join(listed)}."]))
