"""The command line: the one file that knows all parts.

A file of ``controller/cli`` is imported when one of its commands is asked for: ``hold`` must
not wait for what plans and simulates.
"""

from __future__ import annotations

import importlib
import inspect
import json
import sys
from types import ModuleType
from typing import Annotated, Any, NoReturn, TextIO

import typer
from typer.core import TyperCommand, TyperGroup

from controller import messages, one_thread
from controller.cli import help_texts, speech, usage_errors
from controller.commands.table import ALL
from controller.version import VERSION

# File of controller/cli: the commands that it adds, as --help lists them. It has a function or a group
# (``speech.Verbs``) of that name, or a group ``app``; or ``register(app)`` where there is more to say.
FILES = {
    "programs": ("check", "simulate", "demo", "paper"),
    "replay": ("replay",),
    "records": ("export", "compare"),
    "explain": ("explain",),
    "verify": ("verify",),
    "fit": ("fit",),
    "calibrate": ("calibrate",),
    "bring_up": ("bring-up",),
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
    "equipment": ("changer", "maintenance", "probe"),
    "machine_bundle": ("machine",),
    "drives": ("drives",),
    "dnc": ("dnc",),
    "backup": ("backup",),
    "support": ("support",),
    "state": ("state",),
    "service": ("service",),
    "host": ("host",),
    "panel_users": ("users", "tokens"),
}
ENDED_CODE = 130  # as a shell has it: 128 + SIGINT
COMMANDS = {command: file for file, commands in FILES.items() for command in commands}


OF_A_RUNNING_CONTROLLER = ("client", "commands", "client_lists")  # files whose commands --help lists apart
PANEL = "help_frame.production"  # their headline
FROM_A_CHECKOUT = ("bench", "soak")  # files for who works on the controller: --help lists none of theirs


class Commands(TyperGroup):
    """The commands of ``FILES``: listed by their texts, each imported when it is asked for."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands: dict[str, Any] = {name: _listed(name) for name in COMMANDS}

    def format_help(self, ctx: Any, formatter: Any) -> None:
        help_texts.put_own(self)
        help_texts.put_frame(self, messages.of(self._language).texts)
        super().format_help(ctx, formatter)

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        self._language = help_texts.language(args)
        with usage_errors.in_language(self._language):
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: Any) -> Any:
        """A command that is ended by Ctrl-C ends so with every typer that there is."""
        try:
            with usage_errors.in_language(self._language):
                return super().invoke(ctx)
        except KeyboardInterrupt:
            raise typer.Exit(ENDED_CODE) from None

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and args[0] in COMMANDS:
            self.load(args[0])
        return super().resolve_command(ctx, args)

    def load(self, name: str) -> Any:
        """The command itself, with those that its file registers beside it."""
        self.commands.update(_loaded(COMMANDS[name], name))
        return self.commands[name]


def _listed(name: str) -> TyperCommand:
    """What stands for a command in a list."""
    file = COMMANDS[name]
    panel = PANEL if file in OF_A_RUNNING_CONTROLLER else None
    listed = TyperCommand(name, rich_help_panel=panel, hidden=file in FROM_A_CHECKOUT)
    help_texts.put_own(listed, name)
    return listed


def _loaded(file: str, command: str) -> dict[str, Any]:
    """A command of one file by its name, with others where the file registers them together."""
    module = importlib.import_module(f"controller.cli.{file}")
    holder = speech.Verbs()
    if hasattr(module, "register"):
        module.register(holder)
    else:
        _add(holder, command, module)
    found = dict(typer.main.get_group(holder).commands)
    for name, one in found.items():
        help_texts.put(one, name)
    return found


def _add(holder: typer.Typer, name: str, module: ModuleType) -> None:
    """The function of that name, with a "_" after it where the name has another meaning in Python."""
    found = getattr(module, f"{name}_", None) or getattr(module, name.replace("-", "_"), None)
    if inspect.isfunction(found):
        holder.command(name)(found)
    else:  # what else has that name may be a module of another room
        holder.add_typer(found if isinstance(found, typer.Typer) else module.app, name=name)


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


def main() -> NoReturn:
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
    except Exception as error:  # nobody reads a traceback
        from controller.cli import internal_error

        sys.exit(internal_error.end(error, as_json))
    if code == ENDED_CODE:
        words = ended_words()
        print(json.dumps({"ok": False, "error": words}) if as_json else words, file=_output_stream(as_json))
    sys.exit(code)


def ended_words() -> str:
    """What is said after Ctrl-C."""
    return _text("cli.ended")


def _text(key: str, **values: object) -> str:
    """Outside of a verb, in the language of this command line."""
    return messages.text(messages.message(key, **values), help_texts.language())


def _output_stream(as_json: bool) -> TextIO:
    return sys.stdout if as_json else sys.stderr


if __name__ == "__main__":
    main()
