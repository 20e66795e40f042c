"""M48 to M53: what they switch, what M70 to M73 give back, and what they are refused for."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.machines.traced_programs import mill

from controller.machine.model import AdaptiveFeed, Io, Machine, Spindle
from controller.program import blocks
from controller.program.program import JointLine, Overrides, ProgramError, Remark

IO = Io("can0", 9, "", (("feed_stop", 0),), ())


def machine() -> Machine:
    return replace(mill(), io=IO, spindle=Spindle(24000.0))


def after(*lines: str, on: Machine | None = None) -> Overrides:
    """In force on the line behind them."""
    text = "\n".join([*lines, "G1 X1 F100", ""])
    (*_, last) = blocks.read(text.encode(), on or machine(), "p.ngc").blocks
    assert isinstance(last, JointLine)
    return last.modal.overrides


@pytest.mark.parametrize(
    ("lines", "feed", "stop"),
    [
        ((), True, True),
        (("M49",), False, True),
        (("M49", "M48"), True, True),
        (("M50 P0",), False, True),
        (("M49", "M50 P1"), True, True),
        (("M49", "M50"), True, True),
        (("M51 P0",), True, True),
        (("M53 P0",), True, False),
        (("M53 P0", "M53"), True, True),
        (("M53 P0 ", "M48"), True, False),
        (("M52 P0",), True, True),
        (("M70", "M49", "M53 P0", "M72"), True, True),
        (("M49", "M70", "M48", "M72"), False, True),
        (("o1 sub", "M73", "M49", "o1 endsub", "o1 call"), True, True),
        (("M49", "M6 T1"), False, True),
    ],
)
def test_they_switch_and_are_given_back(lines: tuple[str, ...], feed: bool, stop: bool) -> None:
    assert after(*lines) == (feed, stop, False)


@pytest.mark.parametrize("name", ["_feed_override", "_feed_hold"])
def test_a_program_can_ask_for_them(name: str) -> None:
    before = blocks.read(f"G1 X#<{name}> F100\n".encode(), machine(), "p.ngc").blocks[0]
    behind = blocks.read(f"M49\nM53 P0\nG1 X#<{name}> F100\n".encode(), machine(), "p.ngc").blocks[-1]
    assert isinstance(before, JointLine) and isinstance(behind, JointLine)
    assert (before.targets[0], behind.targets[0]) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("M48 M50", "are both overrides codes"),
        ("M49 M51 P1", "are both overrides codes"),
        ("M50 P2", "P2 is neither on nor off"),
        ("M51 P-1", "P-1 is neither on nor off"),
        ("M52", "no adaptive in [spindle]"),
        ("M52 P1", "no adaptive in [spindle]"),
        ("M52 P2", "P2 is neither on nor off"),
        ("M52 M48", "are both overrides codes"),
        ("M49 P1", "no code on this line takes P1"),
    ],
)
def test_what_cannot_be_switched_is_refused(line: str, why: str) -> None:
    with pytest.raises(ProgramError) as error:
        after(line)
    assert why in error.value.sentence


def with_law(law: AdaptiveFeed | None = AdaptiveFeed()) -> Machine:  # noqa: B008 (frozen)
    return replace(machine(), spindle=Spindle(12000.0, adaptive=law))


@pytest.mark.parametrize(
    ("lines", "on"),
    [
        ((), False),
        (("M52",), True),
        (("M52 P1",), True),
        (("M52 P1", "M52 P0"), False),
        (("M52 P1", "M49"), True),
        (("M52 P1", "M70", "M52 P0", "M72"), True),
        (("M70", "M52 P1", "M72"), False),
        (("o1 sub", "M73", "M52 P1", "o1 endsub", "o1 call"), False),
    ],
)
def test_m52_is_modal_where_the_machine_has_a_law_for_it(lines: tuple[str, ...], on: bool) -> None:
    assert after("S1000 M3", *lines, on=with_law()).adaptive is on
    if on:
        with pytest.raises(ProgramError, match="no adaptive in"):
            after("S1000 M3", *lines, on=with_law(None))


def test_a_program_can_ask_for_m52() -> None:
    text = b"S1000 M3\nG1 X#<_adaptive_feed> F100\nM52 P1\nG1 X#<_adaptive_feed>\n"
    lines = [one for one in blocks.read(text, with_law(), "p.ngc").blocks if isinstance(one, JointLine)]
    assert [line.targets[0] for line in lines] == [0.0, 1.0]


def test_m53_names_the_input_that_the_machine_file_lacks() -> None:
    with pytest.raises(ProgramError, match=r"no feed_stop among inputs in \[io\]"):
        after("M53 P1", on=mill())
    assert after("M53 P0", on=mill()) == (True, False, False)


def test_m51_says_that_the_operator_keeps_it() -> None:
    found = blocks.read(b"M51 P0\nG0 X1\nM51 P0\n", machine(), "p.ngc").blocks
    told = [one.sentence for one in found if isinstance(one, Remark)]
    assert len(told) == 1 and "M49 takes all overrides" in told[0]
