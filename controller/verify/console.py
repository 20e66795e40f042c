"""Where the command line speaks: results on standard output, sentences and progress on standard error."""

from __future__ import annotations

import contextlib
import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from functools import cached_property
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from controller import messages

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from controller.machine.toml_table import ConfigError
    from controller.program.program import ProgramError

MAX_WIDTH = 10_000  # of a line, where a table is measured


class Late:
    """A console that is there when something is said: who wants JSON does not wait for it."""

    def __init__(self, **asked: bool) -> None:
        self._asked = asked

    @cached_property
    def console(self) -> Console:
        from rich.console import Console

        return Console(highlight=False, emoji=False, markup=False, **self._asked)  # type: ignore[arg-type]

    def print(self, *said: object, **how: Any) -> None:
        tables = sys.modules.get("rich.table")  # who shows one has imported it
        for table in said:
            if tables is not None and isinstance(table, tables.Table):
                _keep_whole(table, self.console)
                how.setdefault("crop", False)
        self.console.print(*said, **how)

    @property
    def is_terminal(self) -> bool:
        return self.console.is_terminal


def _keep_whole(table: Table, console: Console) -> None:
    """On a terminal that is too narrow nothing of a table is cut, as a number may be what another command
    needs: the first column keeps its width, and words of columns that must not wrap are never broken.
    """
    endless = console.options.update(width=MAX_WIDTH)
    is_drawing = any(column.width is not None for column in table.columns)
    if is_drawing or console.measure(table, options=endless).maximum <= console.width:
        return
    for number, column in enumerate(table.columns):
        found = [console.measure(one, options=endless) for one in (column.header, *column.cells)]
        if number == 0:
            column.min_width = max(one.maximum for one in found)
        elif column.no_wrap:
            column.min_width, column.no_wrap = max(one.minimum for one in found), False
        column.overflow = "fold"


tell = Late(stderr=True, soft_wrap=True)  # sentences, progress
show = Late()  # results

spoken: ContextVar[str] = ContextVar("spoken", default=messages.DEFAULT)  # in which language


def say(key: str, **values: object) -> str:
    """A text of the catalogue in that language."""
    return in_words(messages.message(key, **values))


def in_words(text: Mapping[str, Any] | None) -> str:
    """A text in that language; "" for none."""
    return messages.text(text, spoken.get())


def answered(as_json: bool, /, **facts: Any) -> bool:
    """Prints what a command has done where JSON is asked for; whether it is."""
    if as_json:
        print(json.dumps({"ok": True, **facts}))
    return as_json


def agreed(question: str) -> bool:
    """Asks on standard error, and takes all that is no yes for a no, an input that has ended too."""
    asked = say("console.asked", question=question)
    try:
        answer: str = typer.prompt(asked, default="", show_default=False, err=True)
    except typer.Abort:
        if sys.stdin.isatty():
            raise
        return False
    return answer.strip().lower() in say("console.yes").split()


def word(key: str, otherwise: str = "") -> str:
    """A word that the page has, too, for instance of a result."""
    return messages.of(spoken.get()).page.get(key, otherwise)


Told = Callable[..., None]  # (share done, what is going on now)


@contextlib.contextmanager
def bar(title: str, quiet: bool) -> Iterator[Told]:
    """A progress bar on stderr; the block gets a function of the share done and of a few live words."""
    if quiet or not tell.is_terminal:
        yield lambda share, live="": None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(24),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[live]}"),
    )
    with Progress(*columns, console=tell.console, transient=True) as shown:
        task = shown.add_task(title, total=1.0, live="")
        yield lambda share, live="": shown.update(task, completed=min(share, 1.0), live=live)


class Refused(Exception):
    """Ends a command with exit code 1; the sentence goes to stderr, or into the JSON object."""

    exit_code = 1

    def __init__(self, sentence: str, **facts: Any) -> None:
        super().__init__(sentence)
        self.facts = facts


class Undecided(Refused):
    """Ends it with exit code 9: nothing speaks against it yet, and something that was not named decides."""

    exit_code = 9


class Misunderstood(Refused):
    """Ends it with exit code 2, where 1 is what a good file may lead to: nothing was run."""

    exit_code = 2


AS_ASKED = ("held", "stopped")  # results of runs that only an operator's word makes


class EndedAsAsked(Refused):
    """Ends it with exit code 4: neither a success nor a fault, but an end that the caller has asked for."""

    exit_code = 4


def ended_as_requested(result: str, sentence: str = "", /, **values: Any) -> EndedAsAsked:
    """The end of a run that was held or stopped, or got the fault, that somebody has asked for.

    ``sentence`` goes before that of the end; of ``values`` the line is named in it, and all are its facts.
    """
    told = say(f"ended.{result}", line=values.get("line", 0))
    return EndedAsAsked(f"{sentence} {told}".lstrip(), **{**values, "result": f"{result}_as_asked"})


@contextlib.contextmanager
def refusals(as_json: bool) -> Iterator[None]:
    """Turns what a user can mend into one sentence and exit code 1: every error that is a text, those of
    programs and machine files, and what the system refuses.
    """
    try:
        yield
    except Refused as error:
        _refuse(as_json, str(error), error.facts, error.exit_code)
    except OSError as error:
        key = "os_error_of" if error.filename else "os_error"
        why = messages.message(key, file=error.filename, why=error)
        _refuse(as_json, in_words(why), {})
    except _of_programs() as error:
        place = {"file": error.file, "line": error.line, "column": error.column}
        _refuse(as_json, in_words(error.placed), {**place, **error.said, **error.facts})
    except (messages.TextError, _of_machine_files()) as error:
        own, several = messages.of_error(error), [one.said for one in getattr(error, "mistakes", ())]
        facts = {} if own["key"] == "text" else dict(own)
        if len(several) > 1:
            facts = {"mistakes": several}
        sentences = (in_words(one) for one in several or [own])
        _refuse(as_json, "\n".join(sentences), facts)


def _of_programs() -> type[ProgramError]:
    """Imported when there is an error to look at: most commands never read a program."""
    from controller.program.program import ProgramError

    return ProgramError


def _of_machine_files() -> type[ConfigError]:
    from controller.machine.toml_table import ConfigError

    return ConfigError


def _plain(value: Any) -> Any:
    """For JSON, which has no number that is none, as somebody may have written it: that is a text."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return value if not isinstance(value, float) or math.isfinite(value) else str(value)


def _refuse(as_json: bool, sentence: str, facts: dict[str, Any], exit_code: int = 1) -> NoReturn:
    if as_json:
        print(
            json.dumps(
                {"ok": False, "error": sentence, **_plain(messages.with_sentences(facts, spoken.get()))}
            )
        )
    else:
        tell.print(sentence)
    raise typer.Exit(exit_code)
