"""What a program says to the operator: at its place, with values, each time that it is carried out."""

from __future__ import annotations

import pytest
from support.machines.shipped_kinds import machine

from controller import messages
from controller.machine.kinematics import kinematics_of
from controller.plan.path import path
from controller.program import blocks, source_text
from controller.program.program import CutRuled, OperatorMessage, ProgramError

POINTS = "X0. Y0. Z10.\n" + "\n".join(f"X{k}. Y0. Z10." for k in (3, 6, 9))
LOWER = "\n".join(f"X{k}. Y0. Z0." for k in (0, 3, 6, 9))


def said(text: str) -> list[tuple[int, str]]:
    read = blocks.stream(text.encode(), machine("fig4a"), "p")
    return [(block.place.line, block.text) for block in read if isinstance(block, OperatorMessage)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(MSG, hello)\nG0X1", [(1, "hello")]),
        ("( msg ,Hello (x)\nG0X1", None),
        ("#1=2.5\nG0X1 (debug, a #1 b %d#<_metric> c %.1f#1)", [(2, "a 2.500000 b 1 c 2.5")]),
        ("G0X1 ; (msg, no)\n; (msg, no)\nX2", []),
        ("G0X1 (note) (msg,one)(print,two)", [(1, "one two")]),
        ("o1 repeat [2]\n#1=[#1+1]\n(log,%d#1)\nG0X1\no1 endrepeat", [(3, "1"), (3, "2")]),
        ("/(msg,skipped or not)\nG0X1", [(1, "skipped or not")]),
        ("G0X1\nM2\n(msg,never)", []),
        ("G0X1\n(msg,at the end)", [(2, "at the end")]),
        ("(msg no comma)\nG0X1", []),
        ("#1=1.1234567\n(debug,%f a b: #1 %.2f#1 #1 %d#1 #1)\nG0X1", [(2, "a b: 1.1235 1.12 1.12 1 1")]),
        ("#1=1.1234567\n(debug,%.1f#1)(print,#1 100% %x#1)\nG0X1", [(2, "1.1 1.123457 100% %x1.123457")]),
        ("#1=[0*-1]\n(debug,#1 #<never_set>)\nG0X1", [(2, "0.000000 ######")]),
    ],
)
def test_messages_stand_where_they_are_carried_out(text: str, expected: list[tuple[int, str]] | None) -> None:
    if expected is None:
        with pytest.raises(Exception, match="no partner"):
            said(text)
        return
    assert said(text) == expected


def test_a_message_between_the_points_of_a_surface_parts_nothing() -> None:
    text = f"G52 F100. {POINTS}\n(MSG, lower now)\n{LOWER}\n"
    (cut, message) = blocks.stream(text.encode(), machine("fig4a"), "p")
    assert isinstance(message, OperatorMessage) and isinstance(cut, CutRuled)


def test_a_check_tells_what_is_said_and_the_path_does_not_stop_for_it() -> None:
    built = machine("fig4a")
    program = blocks.read(b"G0X0Y0\nG1F100X1\n(MSG, half)\nX2\n", built, "p")
    with_it = path.trace(program, built, kinematics_of(built), (0.0, 0.0, 50.0, 0.0, 0.0))
    assert [note.sentence for note in with_it.notes] == ["Says here: half"]
    assert len(with_it.items) == len(
        path.trace(
            blocks.read(b"G0X0Y0\nG1F100X1\n\nX2\n", built, "p"),
            built,
            kinematics_of(built),
            (0, 0, 50, 0, 0),
        ).items
    )


def test_a_program_that_ends_itself_is_refused_with_its_reason_where_it_does() -> None:
    text = "#1={}\no1 if [#1 GT 3]\n G0 X1 (abort, depth %.1f#1 is too much)\no1 endif\nG0X1\n"
    assert said(text.format(2)) == []
    with pytest.raises(ProgramError, match=r"ends itself here: .depth 4\.0 is too much.") as refused:
        said(text.format(4))
    assert (refused.value.line, refused.value.column) == (3, 8)


@pytest.mark.parametrize(
    ("ends", "key"),
    [
        ("cycle.tool_off tool=7 off_mm=0.125", "cycle.tool_off"),
        ("cycle.tool_off tool=7", "text.abort"),  # a value is missing
        ("cycle.nothing tool=7", "text.abort"),
        ("a text of its own", "text.abort"),
    ],
)
def test_a_cycle_of_ours_ends_itself_in_the_readers_language(ends: str, key: str) -> None:
    told = source_text.ended(ends)
    assert told["key"] == key
    for language in messages.LANGUAGES:
        shown = messages.text(told, language)
        assert ("T7" in shown and "0.125" in shown) or ends in shown
