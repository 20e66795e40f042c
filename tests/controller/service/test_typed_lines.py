"""Lines typed by hand and macros: whether they move something is known before they run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import FakeEngine, done, engine_of, served, shipped

from controller.ipc.control_socket import CommandRefused
from controller.machine import machine_file
from controller.machine.model import Macro
from controller.messages import text
from controller.service.command_handlers import CommandHandlers
from controller.service.service import Service
from controller.state.modes import Mode

STILL = [
    *("G91", "G90 G21", "G20", "G17 G40 G80", "G54", "G61", "G64 P0.1", "G94 F500", "G98", "G97"),
    *("G0", "G1 F100", "G43 H2", "G49", "T2", "S2000", "M5", "M8", "M7", "M9", "M48", "M0", "M30"),
    *(
        "G4 P1",
        "G10 L2 P1 X5",
        "G92 X0",
        "G21 (MSG, hello)",
        "#<_way>=5\nG21",
        "G90\no1 if [1 gt 2]\nG0 X5\no1 endif",
    ),
]
MOVING = [
    *("G0 X3", "X3", "G91 X1", "G28", "G53 G0 Z0", "G2 X1 I2 F100", "G38.2 Z-5 F100", "G81 Z-5 R1 F100"),
    *(
        "M3 S500",
        "M4 S500",
        "M6 T2",
        "G21\nG90\nX5",
        "#1=3\nG0 X#1",
        "o1 repeat [3]\nG91 G0 X1\no1 endrepeat",
    ),
    *("G0 X[", "o1 while [1]\n#1=1\no1 endwhile"),  # what cannot be read, and what has no end
]


@pytest.mark.parametrize("line", STILL)
def test_a_line_that_moves_nothing_runs_unasked(line: str, desk: CommandHandlers, engine: FakeEngine) -> None:
    done(desk, "mdi", text=line, still=True)
    assert engine.now.mode is Mode.RUNNING


@pytest.mark.parametrize("line", MOVING)
def test_a_line_that_moves_waits_to_be_confirmed(
    line: str, desk: CommandHandlers, engine: FakeEngine
) -> None:
    with pytest.raises(CommandRefused) as refused:
        done(desk, "mdi", text=line, still=True)
    assert refused.value.code == "moves" and text(refused.value.said).startswith(f"{line}\n")
    assert engine.now.mode is Mode.READY and "arm" not in engine.orders
    assert desk.service.run.last is None, "nothing of it is left behind"
    done(desk, "mdi", text=line)
    assert engine.now.mode is Mode.RUNNING


def test_a_bare_word_moves_as_the_lines_before_have_it(desk: CommandHandlers, service: Service) -> None:
    """What is in force counts, as for the line itself."""
    service.run.modal.see(service.run.modal.left._replace(motion="G80"))
    with pytest.raises(CommandRefused) as refused:
        done(desk, "mdi", text="X5", still=True)  # refused by the reader, and not run without being asked
    assert refused.value.code == "moves"


def test_t_moves_where_the_changer_brings_its_pocket(tmp_path: Path) -> None:
    shipped = machine_file.load("machining_centre")
    changer = shipped.changer
    assert changer is not None
    for prepare in ((), changer.take[:1]):
        machine = replace(shipped, changer=replace(changer, prepare=prepare))
        service = served(tmp_path / str(len(prepare)), machine)
        desk = CommandHandlers(service)
        done(desk, "changer_confirm", spindle=1, away=[], clear=True)
        code = "moves" if prepare else ""
        assert code_of(desk, "mdi", text="T2", still=True) == code


def code_of(desk: CommandHandlers, verb: str, **args: Any) -> str:
    """ "" where it is not refused."""
    try:
        done(desk, verb, **args)
    except CommandRefused as refused:
        return refused.code
    return ""


MACROS = (
    Macro("Park", ("G53 G0 Z0", "G53 G0 X0"), "operate"),
    Macro("Warm up", ("M3 S500",), "set_up"),
    Macro("Metric", ("G21",), "operate"),
)


@pytest.fixture
def with_macros(tmp_path: Path) -> CommandHandlers:
    return CommandHandlers(served(tmp_path, replace(shipped(), macros=MACROS)))


@pytest.mark.parametrize(
    ("name", "role", "code"),
    [
        ("Park", "operate", ""),
        ("Park", "view", "role"),
        ("Warm up", "operate", "role"),
        ("Warm up", "set_up", ""),
        ("Of none", "set_up", "missing"),
    ],
)
def test_a_macro_runs_for_who_has_its_role(
    name: str, role: str, code: str, with_macros: CommandHandlers
) -> None:
    desk, service = with_macros, with_macros.service
    assert code_of(desk, "macro", name=name, role=role) == code
    assert (engine_of(service).now.mode is Mode.RUNNING) == (code == "")
    if not code:
        job = service.run.job
        assert job is not None and job.is_mdi
        assert bytes(job.program.text).decode() == "\n".join(next(m.lines for m in MACROS if m.name == name))


def test_a_macro_that_moves_waits_to_be_confirmed(with_macros: CommandHandlers) -> None:
    assert code_of(with_macros, "macro", name="Park", still=True) == "moves"
    assert code_of(with_macros, "macro", name="Metric", still=True) == ""
