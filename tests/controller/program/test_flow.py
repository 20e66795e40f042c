"""The order in which lines are carried out. What comes of each program was read off LinuxCNC's rs274."""

from __future__ import annotations

import pytest
from support.machines.shipped_kinds import machine

from controller.program import blocks, flow, words
from controller.program.program import JointLine, ProgramError
from controller.program.source_text import text_of

SUM = "o100 sub\nG0X#1\no101 if [#1 gt 0]\no100 call [#1 - 1]\no101 endif\nG0Y#1\no100 endsub\n"


def moves(text: str, block_delete: bool = False) -> str:
    """The words of every move as it is carried out."""
    found = []
    for block in blocks.stream(text.encode(), machine("fig4a"), "part.ngc", block_delete):
        if isinstance(block, JointLine):
            named = zip("XYZ", block.targets, strict=False)
            found.append("".join(f"{axis}{value:g}" for axis, value in named if value is not None))
    return " ".join(found)


def refusal(text: str) -> ProgramError:
    with pytest.raises(ProgramError) as caught:
        moves(text)
    return caught.value


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("#1=0\no1 repeat [2.7]\n#1=[#1+1]\no1 endrepeat\nG0 X#1", "X3"),
        ("#1=0\no1 repeat [2.5]\n#1=[#1+1]\no1 endrepeat\nG0 X#1", "X2"),
        ("o1 repeat [-1]\nG0X1\no1 endrepeat\nG0Y1", "Y1"),
        ("#1=3\no1 if [#1 eq 3]\nG0X1\no1 elseif [#1 gt 0]\nG0X2\no1 else\nG0X3\no1 endif", "X1"),
        ("#1=2\no1 if [#1 eq 3]\nG0X1\no1 elseif [#1 gt 0]\nG0X2\no1 else\nG0X3\no1 endif", "X2"),
        ("#1=-2\no1 if [#1 eq 3]\nG0X1\no1 elseif [#1 gt 0]\nG0X2\no1 else\nG0X3\no1 endif", "X3"),
        ("#1=-2\no1 if [#1 eq 3]\nG0X1\no1 endif\nG0Y1", "Y1"),
        ("#1=2\no1 while [#1 gt 0]\nG0X#1\n#1=[#1-1]\no1 endwhile", "X2 X1"),
        ("#1=2\no1 do\nG0X#1\n#1=[#1-1]\no1 while [#1 gt 0]", "X2 X1"),
        ("#1=-2\no1 do\nG0X#1\n#1=[#1-1]\no1 while [#1 gt 0]\nG0Y1", "X-2 Y1"),
        ("#1=3\no1 while [#1]\n#1=[#1-1]\no1 break\no1 endwhile\nG0X#1", "X2"),
        (
            "#1=3\no1 do\n#1=[#1-1]\no2 if [#1 eq 1]\no1 continue\no2 endif\nG0X#1\no1 while [#1 gt 0]",
            "X2 X0",
        ),
        ("o1 repeat [3]\no2 repeat [2]\nG0X1\no1 continue\no2 endrepeat\nG0X9\no1 endrepeat", "X1 X1 X1"),
        ("o1 repeat [2]\no2 repeat [3]\nG0X1\no2 break\no2 endrepeat\nG0Y1\no1 endrepeat", "X1 Y1 X1 Y1"),
        (SUM + "o100 call [3]", "X3 X2 X1 X0 Y0 Y1 Y2 Y3"),
        ("o1 call\nG0X1\nM2\no1 sub\nG0X2\no1 endsub", "X2 X1"),
        ("#1=2\no[#1+98] call\nG0X9\nM2\no100 sub\nG0X5\no100 endsub", "X5 X9"),
        ("#1=100\no#1 call\nG0X9\nM2\no100 sub\nG0X5\no100 endsub", "X5 X9"),
        ("o<abc> sub\nG0X1\no<abc> return [7]\nG0X2\no<abc> endsub\nO<A bc> CALL\nG0Y#<_value>", "X1 Y7"),
        ("o1 sub\n#<a>=1\nG0X#<a>\no1 endsub\n#<a>=7\n#<_g>=5\no1 call\nG0X#<a>\nX#<_g>", "X1 X7 X5"),
        ("o1 sub\nG0X#1Y#2Z#3\n#1=9\no1 endsub\n#1=5\no1 call [1] [2]\nG0X#1", "X1Y2Z0 X5"),
        ("#1=5\nM98 P100 L2\nG0X#1\nM30\nO100\nG0Y#1\n#1=[#1+1]\nM99", "Y5 Y6 X7"),
        ("#<a>=4\nM98 P100\nG0Z[exists[#<a>]]\nM30\nO100\nG0Z[exists[#<a>]]\nM99", "Z0 Z1"),
        ("M98 P100 L2\nM30\nO100\nG0Z[exists[#<a>]]\n#<a>=1\nM99", "Z0 Z0"),
        ("M98 P100 L0\nG0X9\nM2\nO100\nG0 X1\nM99", "X9"),
        ("M98 P30100\nG0X9\nM2\nO100\nG0 X1\nM99", "X1 X1 X1 X9"),
        ("%\nO1\nM98 P0100\nM30\nO100\nG0 X1\nM99\n%\nG0X5", "X1"),
        ("o1 sub\no2 if [1]\nG0X1\no2 endif\no1 endsub\no2 if [1]\nG0X2\no2 endif\no1 call", "X2 X1"),
        ("(a) N10 (b) o1 repeat [2] (c)\nG0X1\nn20.5 o1 endrepeat ; d", "X1 X1"),
    ],
)
def test_lines_are_carried_out_in_the_references_order(text: str, expected: str) -> None:
    assert moves(text) == expected
    assert moves(text.replace("\n", "\r\n")) == expected


@pytest.mark.parametrize(
    ("text", "place", "phrase"),
    [
        ("o1 call", "1:1", "there is no sub 1"),
        ("G0X1\nM99", "2:1", "ends subs that M98 calls"),
        ("o1 if [1]\no1 endif\no1 if [1]\no1 endif", "3:1", "used on line 1"),
        ("o1 sub\no2 sub\no2 endsub\no1 endsub", "2:1", "stands inside of o1 sub"),
        ("o1 while [1]\nG0X1", "1:1", "o1 while has no end: write o1 endwhile"),
        ("o1 if [1]\no2 while [0]\no1 endif\no2 endwhile", "3:1", "o2 while of line 2 is open"),
        ("o1 if [1]\no1 else\no1 elseif [1]\no1 endif", "3:1", "else is last"),
        ("o1 break", "1:1", "stands in no loop o1"),
        ("o1 return", "1:1", "outside of every sub"),
        ("o1 foo", "1:1", "FOO behind o1 is no O-word"),
        ("o if [1]\no1 endif", "1:1", "no number"),
        ("o1 if 1\no1 endif", "1:7", "[ is missing"),
        ("o1 if [1] G0\no1 endif", "1:1", "G0 stands behind o1 if"),
        ("o<a> sub\nG0X1\no<a> endsub", "1:1", "start the program that calls a"),
        ("o1 if [1]\no1 if [1]\no1 endif\no1 endif", "2:1", "used on line 1"),
        ("o1 do\no1 while [0]\no1 while [0]\no1 endwhile", "3:1", "used on line 1"),
        ("o1 sub\no2 if [#1]\no2 endif\no2 if [#1]\no2 endif\no1 endsub\no1 call", "4:1", "used on line 2"),
        ("/o1 if [1]\no1 endif", "1:2", "write it before every O-word"),
        ("o1 if [1]\n/o1 else\no1 endif", "2:2", "write it before every O-word"),
        ("/o1 while [1]\no1 break\n/o1 endwhile", "1:2", "write it before every O-word"),
        ("/o1 sub\n/o1 endsub", "1:2", "before sub and endsub, none"),
        ("G0X1 o1 call", "1:6", "stands alone on its line"),
        ("X1O", "1:3", "is it a zero"),
        ("M98\nM2", "1:1", "write P"),
        ("M98 P7\nM2", "1:1", "there is no O7"),
        ("o7 call\nM2\nO7\nG0X1\nM99", "1:1", "called with M98 P7"),
        ("M98 P7\nM2\no7 sub\no7 endsub", "1:1", "called with o7 call"),
        ("G0X1\nO7\nG0X2\nM99", "2:1", "runs into o7"),
        ("M98 P7\nM2\nO7\nG0X2", "4:1", "write M99 at its end"),
        ("o1 sub\nG1X#1\no1 endsub\no1 call [3]", "2:1", "called by o1 call on line 4 of part.ngc"),
        ("o1 sub\nG0X\no1 endsub\no1 call [3]", "2:3", "called by o1 call on line 4 of part.ngc"),
        ("o1 sub\no1 call\no1 endsub\no1 call", "2:1", "deeper than 10 subs"),
    ],
)
def test_a_wrong_structure_is_refused_where_it_is_wrong(text: str, place: str, phrase: str) -> None:
    error = refusal(text)
    assert str(error).startswith(f"part.ngc:{place}: ") and phrase in error.sentence


EITHER = "o1 if [#1]\no2 if [1]\nG0X1\no2 endif\no1 else\no2 if [1]\nG0X2\no2 endif\no1 endif\n"


def test_structures_of_which_one_runs_may_have_one_label() -> None:
    """As LinuxCNC, whose own measuring of tools is written so."""
    assert moves(EITHER) == "X2"
    assert moves("#1=1\n" + EITHER) == "X1"
    assert (
        moves("#31=0\n" + EITHER + "o9 sub\no1 if [0]\no2 if [0]\no2 endif\no1 endif\no9 endsub\no9 call")
        == "X2"
    )


@pytest.mark.parametrize(("deleting", "expected"), [(False, "X1 X4"), (True, "X1 X2 X3 X4")])
def test_a_whole_structure_may_be_left_out_by_block_delete(deleting: bool, expected: str) -> None:
    text = "G0X1\n/o1 if [0]\nX2\n/o1 else\n/o2 repeat [0]\nX3\n/o2 endrepeat\n/o1 endif\nX4"
    assert moves(text, deleting) == expected


def test_a_loop_without_end_ends_with_a_sentence() -> None:
    read = words.read(text_of(b"o1 while [1]\no1 endwhile\n", "p")[0], "p", limits=flow.Limits(passes=50))
    with pytest.raises(ProgramError, match=r"50 times, which is the most \(program_passes"):
        list(read)


def test_places_rise_in_order_and_tell_the_line() -> None:
    text = "G0X1\no1 repeat [3]\nX2\nX3\no1 endrepeat\nX4\n"
    read = blocks.read(text.encode(), machine("fig4a"), "p").blocks
    assert [block.place.line for block in read] == [1, 3, 4, 3, 4, 3, 4, 6]
    orders = [block.place.order for block in read]
    assert orders == sorted(set(orders)) and orders[:3] == [1, 3, 4]


def test_a_program_without_flow_is_counted_by_its_lines() -> None:
    read = blocks.read(b"O12\nG0X1\n\nX2\n", machine("fig4a"), "p").blocks
    assert [block.place.order for block in read] == [2, 4]
