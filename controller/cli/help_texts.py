"""The texts of ``--help``: of the commands and of all that they take, in the reader's language.

Nothing of them is in the commands. In the catalogue they are found by the command's path, as
``help.calibrate.axis``, and below it by the name of what it takes, ``help.calibrate.axis.--axis``; what many
commands take has its text once, as ``help.--machine``. They are put in when a command is made, and so in time
for help, for completion and for the list of all commands.
"""

from __future__ import annotations

import copy
import os
import sys
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import typer

from controller import messages

ENVIRONMENT = "DIRECTRIX_LANGUAGE"
# Where simulated drives have their bus if nothing is said; a constant, for help imports nothing that works.
CHANNEL = Path(tempfile.gettempdir()) / "directrix-can"


def language(line: Sequence[str] | None = None) -> str:
    """That help is read in: of --language on a command line, this process' own, else of the environment."""
    words = [word for one in (sys.argv if line is None else line) for word in one.split("=", 1)]
    asked = [word for option, word in pairwise(words) if option == "--language"]
    return messages.chosen(*asked[-1:], os.environ.get(ENVIRONMENT, ""))


def put(command: Any, path: str) -> None:
    """Gives a command, and those below it, their texts. ``path``: its names, with dots between."""
    put_own(command, path)
    for name, below in getattr(command, "commands", {}).items():
        put(below, f"{path}.{name}")


def put_own(command: Any, path: str = "") -> None:
    """Gives it, and what it takes, its texts; "" is the command line itself."""
    texts = messages.of(language()).texts
    values = {"languages": ", ".join(messages.LANGUAGES), "channel": CHANNEL}
    own = f"help.{path}" if path else "help"
    command.help = texts[own]
    for one in command.params:
        name = next((option for option in one.opts if option.startswith("--")), one.name)
        one.help = (texts.get(f"{own}.{name}") or texts[f"help.{name}"]).format(**values)
    panel = getattr(command, "rich_help_panel", None)
    if isinstance(panel, str):
        command.rich_help_panel = texts.get(panel, panel)
    if language() != messages.DEFAULT:
        _frame_when_shown(command, texts)


def _frame_when_shown(command: Any, texts: dict[str, str]) -> None:
    """The frame needs what help is made of, which no other command is to wait for."""
    shown = type(command).format_help

    def format_help(ctx: Any, formatter: Any) -> None:
        put_frame(command, texts)
        shown(command, ctx, formatter)

    command.format_help = format_help


def put_frame(command: Any, texts: dict[str, str]) -> None:
    """What typer says around the texts, which has only English."""
    from typer import rich_utils  # of which help is made

    frame = {
        key.removeprefix("help_frame."): one for key, one in texts.items() if key.startswith("help_frame.")
    }
    rich_utils.ARGUMENTS_PANEL_TITLE = frame["arguments"]
    rich_utils.OPTIONS_PANEL_TITLE = frame["options"]
    rich_utils.COMMANDS_PANEL_TITLE = frame["commands"]
    rich_utils.DEFAULT_STRING = f"[{frame['default']}: {{}}]"
    rich_utils.ENVVAR_STRING = f"[{frame['environment']}: {{}}]"
    rich_utils.REQUIRED_LONG_STRING = f"[{frame['required']}]"
    for one in command.params:
        _name_kind(one, frame)
    option = command.get_help_option(typer.Context(command))
    if option is not None:
        option.help = frame["help"]

    command.options_metavar = f"[{frame['options_place']}]"
    if hasattr(command, "subcommand_metavar"):
        command.subcommand_metavar = frame["commands_place"]

    def format_usage(ctx: Any, formatter: Any) -> None:
        pieces = " ".join(command.collect_usage_pieces(ctx))
        formatter.write_usage(ctx.command_path, pieces, prefix=f"{frame['usage']}: ")

    command.format_usage = format_usage


def _name_kind(taken: Any, frame: dict[str, str]) -> None:
    """A number, a path ... in words; a choice shows its values instead."""
    kind = frame.get(f"type.{str(taken.type.name).removesuffix(' range')}")
    if kind is not None:
        taken.type = copy.copy(taken.type)  # of many options
        taken.type.name = kind
