"""The command line: the one file that knows all parts.

A file of ``controller/cli`` is imported when one of its commands is asked for: ``hold`` must
not wait for what plans and simulates.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import inspect
import json
import os
import sys
import threading
from types import ModuleType
from typing import Annotated, Any, NoReturn, TextIO

_COLLECTS = gc.isenabled()
gc.disable()  # what is imported stays: thirty looks through it find nothing

import typer  # noqa: E402
from typer.core import TyperGroup  # noqa: E402

from controller import messages, one_thread  # noqa: E402
from controller.cli import declarations, help_texts, speech, usage_errors  # noqa: E402
from controller.commands.table import ALL  # noqa: E402
from controller.version import VERSION  # noqa: E402

if _COLLECTS:
    gc.enable()

# File of controller/cli: the commands that it adds, as --help lists them. It has a function of that
# name, or a Typer called ``app`` or like the command; or ``register(app)`` where there is more to say.
FILES = {
    "programs": ("check", "simulate", "demo", "paper"),
    "replay": ("replay",),
    "records": ("export", "compare"),
    "explain": ("explain",),
    "verify": ("verify",),
    "fit": ("fit",),
    "calibrate": ("calibrate",),
    "cad": ("import",),
    "post": ("post",),
    "bench": ("bench",),
    "soak": ("soak",),
    "bus": ("bus",),
    "faults": ("faults",),
    "serve": ("serve",),
    "panel": ("panel",),
    "client": ("start", "override", "jog"),
    "commands": tuple([command.client.name for command in ALL if command.client is not None]),
    "client_lists": ("status", "upload", "runs", "alarms"),
    "offsets": ("offsets",),
    "tools": ("tools",),
    "changer": ("changer",),
    "maintenance": ("maintenance",),
    "probe": ("probe",),
    "drives": ("drives",),
    "dnc": ("dnc",),
    "backup": ("backup",),
    "service": ("service",),
    "host": ("host",),
    "panel_users": ("users", "tokens"),
}
ENDED_CODE = 130  # as a shell has it: 128 + SIGINT
COMMANDS = {command: file for file, commands in FILES.items() for command in commands}


class Commands(TyperGroup):
    """The commands of ``FILES``, each imported when it is asked for."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands: dict[str, Any] = dict.fromkeys(COMMANDS)  # by their names a mistyped one is helped

    def format_help(self, ctx: Any, formatter: Any) -> None:
        help_texts.put_own(self)
        help_texts.put_frame(self, messages.of(self._language).texts)
        super().format_help(ctx, formatter)

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        self._language = help_texts.language(args)
        with usage_errors.told_in(self._language):
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: Any) -> Any:
        """A command that is ended by Ctrl-C ends so with every typer that there is."""
        try:
            with usage_errors.told_in(self._language):
                return super().invoke(ctx)
        except KeyboardInterrupt:
            raise typer.Exit(ENDED_CODE) from None

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name in COMMANDS and self.commands[cmd_name] is None:
            self.commands.update(_loaded(COMMANDS[cmd_name], cmd_name))
        return self.commands.get(cmd_name)


def _loaded(file: str, command: str) -> dict[str, Any]:
    """A command of one file by its name, with others where the file registers them together."""
    with declarations.only() if declarations.asked_for() else contextlib.nullcontext():
        module = _imported(f"controller.cli.{file}")
    holder = typer.Typer()
    if hasattr(module, "register"):
        module.register(holder)
    else:
        _add(holder, command, module)
    if declarations.are_listed():
        _bare(holder)
    else:
        speech.teach(holder)
    found = dict(typer.main.get_group(holder).commands)
    for name, one in found.items():
        help_texts.put(one, name)
    return found


def _imported(name: str) -> ModuleType:
    """A module, the collector resting meanwhile: what is imported stays, and is never looked through."""
    if name in sys.modules or not gc.isenabled():
        return importlib.import_module(name)
    gc.disable()
    try:
        module = importlib.import_module(name)
        gc.freeze()
    finally:
        gc.enable()
    return module


def _add(holder: typer.Typer, name: str, module: ModuleType) -> None:
    found = getattr(module, name, None)
    if inspect.isfunction(found):
        holder.command(name)(found)
    else:  # what else has that name may be a module of another room
        holder.add_typer(found if isinstance(found, typer.Typer) else module.app, name=name)


def _bare(holder: typer.Typer) -> None:
    """Leaves of the commands what a list of them shows: their options would take most of the time."""
    for one in holder.registered_commands:
        one.help, one.callback = one.help or inspect.getdoc(one.callback), lambda: None
    for group in holder.registered_groups:
        if group.typer_instance is not None:
            group.typer_instance.registered_commands.clear()


app = typer.Typer(cls=Commands, no_args_is_help=True, pretty_exceptions_enable=False)


def _version(asked: bool) -> None:
    if asked:
        print(f"directrix {VERSION}")
        raise typer.Exit


@app.callback()
def directrix(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True)] = False,
) -> None:
    """A five-axis controller that cuts ruled surfaces themselves."""


def script() -> NoReturn:
    """Entry point of ``directrix``."""
    try:
        main()
    except SystemExit as ended:
        leave(ended.code)
    leave(None)


def leave(code: str | int | None) -> NoReturn:
    """End this process: Python would take apart, for 20 ms, all that goes with it anyway.

    In Python's own way where another thread is at work, or what was said cannot be written.
    """
    if threading.active_count() == 1 and not isinstance(code, str):
        with contextlib.suppress(OSError):
            atexit._run_exitfuncs()
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code or 0)
    sys.exit(code)


def main() -> None:
    """The command line; a script that asks for JSON gets it whatever is wrong. Raises SystemExit."""
    one_thread.set_default()
    as_json = "--json" in sys.argv[1:]
    try:
        code = app(standalone_mode=not as_json)
    except SystemExit as ended:
        code = ended.code
    except usage_errors.USAGE as error:
        sentence = _text("cli.usage", why=error.format_message().rstrip("."))
        print(json.dumps({"ok": False, "error": sentence}))
        sys.exit(2)
    except (typer.Abort, KeyboardInterrupt):
        code = ENDED_CODE
    except declarations.Undeclared:
        declarations.begin_again()
    except Exception as error:  # nobody reads a traceback
        from controller.cli import internal_error

        sys.exit(internal_error.end(error, as_json))
    if code == ENDED_CODE:
        words = ended_words()
        print(json.dumps({"ok": False, "error": words}) if as_json else words, file=_spoken(as_json))
    gc.freeze()  # what is left goes with the process: Python looks through all of it before
    sys.exit(code)


def ended_words() -> str:
    """What is said after Ctrl-C."""
    return _text("cli.ended")


def _text(key: str, **values: object) -> str:
    """Outside of a verb, in the language of this command line."""
    return messages.text(messages.said(key, **values), help_texts.language())


def _spoken(as_json: bool) -> TextIO:
    return sys.stdout if as_json else sys.stderr


if __name__ == "__main__":
    main()
