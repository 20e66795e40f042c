"""What a user reads is a text of the catalogue: no sentence is written where it is raised."""

from __future__ import annotations

import ast
import re
import string
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from controller import messages
from controller.machine import machine_file
from controller.machine.toml_table import ConfigError
from controller.messages import LANGUAGES

CONTROLLER = Path(messages.__file__).parent.parent
SENTENCE = re.compile(r"[a-z]+ [a-z]+ [a-z]+")


@cache
def calls(name: str) -> list[tuple[str, ast.Call]]:
    """Of a function or a method of that name, with their files."""
    sources = {file: file.read_text() for file in CONTROLLER.rglob("*.py")}
    named = {file: ast.parse(text) for file, text in sources.items() if name in text}
    return [
        (str(file.relative_to(CONTROLLER)), one)
        for file, tree in named.items()
        for one in ast.walk(tree)
        if isinstance(one, ast.Call) and name in (getattr(one.func, part, "") for part in ("id", "attr"))
    ]


def test_every_refusal_of_a_file_of_tables_is_a_text_with_just_the_values_that_it_has_places_for() -> None:
    found = 0
    for file, call in calls("refuse"):
        if len(call.args) != 2 or not isinstance(call.args[1], ast.Constant):
            continue
        words = LANGUAGES["en"].texts[f"file.{call.args[1].value}"]
        places = {name for _, name, _, _ in string.Formatter().parse(words) if name}
        assert places == {one.arg for one in call.keywords}, (file, call.lineno)
        found += 1
    assert found > 90


def test_no_sentence_is_handed_to_an_error_of_the_machine_file() -> None:
    for file, call in (*calls("ConfigError"), *calls("refuse")):
        for text in (one.value for one in ast.walk(call) if isinstance(one, ast.Constant)):
            assert not isinstance(text, str) or not SENTENCE.search(text), (file, call.lineno, text)


# Rooms in which every sentence that a person reads is a text of the catalogue.
DONE = ("cli", "api", "commands", "service", "cad")
DRIVES = CONTROLLER.parent / "drives"
SHOWS = ("print", "confirm", "prompt", "bar", "Refused", "Misunderstood", "BadParameter", "tell_done")
# Raised at who programs, or caught where it is raised.
OWN = {"ValueError", "TypeError", "RuntimeError", "AssertionError", "NotImplementedError", "KeyError"}
OWN |= {"FileExistsError", "OSError", "dataclasses.FrozenInstanceError"}
PHRASE = re.compile(r"[A-Za-z]{2,},? [a-z]{2,}")


def shown(tree: ast.AST) -> Iterator[ast.Call]:
    """What is raised at somebody, printed or asked."""
    for one in ast.walk(tree):
        raised = one.exc if isinstance(one, ast.Raise) else None
        if isinstance(raised, ast.Call) and ast.unparse(raised.func) not in OWN:
            yield raised
        if isinstance(one, ast.Call) and getattr(one.func, "attr", getattr(one.func, "id", "")) in SHOWS:
            yield one


def literals(call: ast.Call) -> list[str]:
    """Phrases written where they are shown, in f-strings too."""
    texts = [one.value for one in ast.walk(call) if isinstance(one, ast.Constant)]
    return [text for text in texts if isinstance(text, str) and PHRASE.search(text)]


def test_no_sentence_is_written_where_it_is_shown_or_raised() -> None:
    files = [file for room in DONE for file in (CONTROLLER / room).rglob("*.py")]
    files += DRIVES.rglob("*.py")
    found = [
        f"{file}:{call.lineno}: {text}"
        for file in files
        for call in shown(ast.parse(file.read_text()))
        for text in literals(call)
    ]
    assert len(files) > 100 and not found


def phrases(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and words of every phrase that is written, but in documentation and in errors of ``OWN``."""
    left_out: set[ast.AST] = set()
    for one in ast.walk(tree):
        if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant):
            left_out.add(one.value)
        if isinstance(one, ast.Raise) and isinstance(one.exc, ast.Call) and ast.unparse(one.exc.func) in OWN:
            left_out |= set(ast.walk(one.exc))
    for one in ast.walk(tree):
        words = one.value if isinstance(one, ast.Constant) and one not in left_out else None
        if isinstance(words, str) and PHRASE.search(words):
            yield one.lineno, words


# Rooms without any phrase, and what looks like one in them and is read by no person as a sentence.
VERIFY = CONTROLLER / "verify"
BARE = (
    *(DRIVES, VERIFY, CONTROLLER / "cli" / "usage_errors.py", CONTROLLER / "own_files.py"),
    *(
        CONTROLLER / "api" / "metrics.py",
        CONTROLLER / "runtime" / "records.py",
        CONTROLLER / "cli" / "records.py",
    ),
    *(CONTROLLER / "service" / "socket_server.py", CONTROLLER / "ipc" / "control_socket.py"),
)
NOT_READ = {
    ("dcf.py", "Set-up of node "),  # in files: data sheets are English
    ("sheet.py", "Number of entries"),
    ("family_sheet.py", "Simulated drive of the family "),
    ("error_control.py", "heartbeat of "),  # names of a simulated device's timers
    ("inputs.py", "torque off"),
    ("lss.py", "bit rate"),
    ("sync.py", "sync producer"),
    ("sync.py", "sync time-out"),
    ("dictionary.py", "SDO abort "),  # caught where it is raised
    ("fault_kinds.py", "at sync "),  # the grammar of a script of faults
    ("fault_grammar.py", "sync, rpdo 3, tpdo 3, heartbeat 3, emcy 3"),
    ("cia402.py", "quick stop"),  # a value of an enumeration
    *((file, place) for file in ("bus_report.py", "pictures.py") for place in ("upper left", "lower right")),
    ("pictures.py", "lower center"),  # of a legend
    ("fits.py", "bull nose"),  # of JSON
    *(("forms.py", name) for name in ("lead in", "lead out")),  # by which texts are looked up
    *((file, name) for file in ("gouges.py", "looks.py") for name in ("own cut", "other motion")),
    ("values.py", " is made_here else "),  # code
}
MARKUP = ("html_page.py",)  # of SVG and HTML; all words are given to them


def test_no_phrase_at_all_is_written_in_rooms_that_have_given_theirs_to_the_catalogue() -> None:
    files = [file for room in BARE for file in ([room] if room.suffix else room.rglob("*.py"))]
    found = [
        f"{file}:{line}: {text}"
        for file in files
        for line, text in phrases(ast.parse(file.read_text()))
        if (file.name, text) not in NOT_READ and file.name not in MARKUP
    ]
    assert len(files) > 100 and not found, "\n".join(found)


def test_a_phrase_that_is_written_somewhere_is_found() -> None:
    text = 'def refusal():\n    """It says why."""\n    return f"drive {name} is off now"'
    assert [*phrases(ast.parse(text))] == [(3, " is off now")]


@pytest.mark.parametrize(
    "text",
    [
        'raise Refused("there is none")',
        'raise StoreError("form", f"{name}: is no name")',
        'show.print(f"{name} was removed.")',
        'typer.confirm("Start at this line?")',
    ],
)
def test_a_sentence_that_is_written_there_is_found(text: str) -> None:
    assert any(map(literals, shown(ast.parse(text))))


@pytest.mark.parametrize(
    ("was", "wrong", "german"),
    [
        ("", "bus_ms = 1\n", "machine.toml:1: oberste Ebene: bus_ms = 1: diesen Schlüssel gibt es nicht;"),
        (
            "period_s = 0.002",
            "period_s = 9.0",
            "period_s = 9.0: ist außerhalb des Bereichs; erlaubt: eine Zahl",
        ),
        ("[machine]", "[machine", "machine.toml:6:9: [machine: ist kein TOML: die Klammern"),
    ],
)
def test_a_machine_file_is_refused_in_german_too(was: str, wrong: str, german: str) -> None:
    whole = machine_file.load("trunnion").text
    with pytest.raises(ConfigError) as refused:
        machine_file.read(whole.replace(was, wrong, 1), "machine.toml")
    assert german in messages.text(refused.value.said, "de")
    assert messages.text(refused.value.said, "de") != str(refused.value)
