"""Calls of Fanuc's custom macros: what each parameter is, when they are called, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.oracles import reference_interpreter

from controller.program import blocks, linked
from controller.program.program import JointLine, ProgramError, Remark

SHOWS = "O9010\n{}\nM99\n"  # a macro that shows numbers as X


def ends(text: str, without_point: str = "unit", dialect: str = "fanuc") -> list[float]:
    """X at the end of each line of a program."""
    on = replace(reference_interpreter.machine(dialect), program_passes=50, without_point=without_point)
    read = blocks.read(f"G21 G90 G0\n{text}".encode(), on, "p.nc").blocks
    return [
        block.targets[0] for block in read if isinstance(block, JointLine) and block.targets[0] is not None
    ]


def shown(call: str, *numbers: int, without_point: str = "unit") -> list[float]:
    body = "\n".join(f"X#{number}" for number in numbers)
    return ends(f"{call}\nM30\nO9010\n{body}\nM99\n", without_point)


@pytest.mark.parametrize(
    ("call", "numbers", "values"),
    [
        (
            "G65 P9010 A1. B2. C3. D7. E8. F9. H11. M13.",
            (1, 2, 3, 7, 8, 9, 11, 13),
            [1, 2, 3, 7, 8, 9, 11, 13],
        ),
        ("G65P9010Q17.R18.S19T20U21.V22.W23.X24.Y25.Z26.", range(17, 27), [*range(17, 27)]),
        ("G65 P9010 I4. J5. K6.", (4, 5, 6), [4, 5, 6]),
        ("G65 I1. J2. K3. I4. J5. K6. I7. P9010", range(4, 11), [*range(1, 8)]),
        ("G65 P9010 K1. J2. I3.", (6, 8, 10), [1, 2, 3]),  # each begins a set
        ("G65 P9010 J1. J2. K3.", (5, 8, 9), [1, 2, 3]),
        ("G65 A1. B2. I-3. I4. D5. P9010", (1, 2, 4, 7), [1, 2, -3, 5]),  # Fanuc's own example
        ("G65 P9010 D5. I1. I2.", (4, 7), [1, 2]),  # the last one counts
        ("G65 P9010" + "".join(f" I{k}. J{k}.1 K{k}.2" for k in range(10)), (31, 32, 33), [9.0, 9.1, 9.2]),
        ("G90 G65 P9010 A[1+2]", (1,), [3]),
        ("#1=5.\nG65 P9010 A[#1+1] B#1", (1, 2), [6, 5]),
    ],
)
def test_a_letter_is_a_parameter_of_the_macro(
    call: str, numbers: tuple[int, ...], values: list[float]
) -> None:
    assert shown(call, *numbers) == pytest.approx(values)


def test_a_macro_has_parameters_of_its_own() -> None:
    text = "#1=5.\n#33=6.\n#100=7.\nG65 P9010 B1.\nX#1\nX#33\nX#100\nM30\n"
    assert ends(text + "O9010\n#1=8.\n#33=9.\n#100=#100+#2\nX#1\nM99") == [8, 5, 6, 8]


def test_a_sub_of_m98_shares_those_of_the_macro_that_calls_it() -> None:
    text = "#31=1.\nG65 P9010 A2.\nX#31\nM30\nO9010\n#31=3.\nM98 P7\nX#1\nM99\nO7\nX#31\n#1=#1+2.\nM99"
    assert ends(text) == [3, 4, 1]


def test_macros_call_macros() -> None:
    text = "G65 P9010 A1.\nM30\nO9010\nG65 P9011 A[#1+1]\nX#1\nM99\nO9011\nX#1\nM99"
    assert ends(text) == [2, 1]


def test_a_round_finds_what_the_one_before_has_left() -> None:
    assert ends("G65 P9010 L3 A1.\nX9.\nM30\nO9010\nX#1\n#1=#1+1.\nM99") == [1, 2, 3, 9]
    assert ends("G65 P9010 L0 A1.\nX9.\nM30\nO9010\nX#1\nM99") == [9]


def test_what_is_not_given_is_vacant() -> None:
    macro = "M30\nO9010\nIF [#24 EQ #0] GOTO 10\nX#24\nGOTO 20\nN10 X-1.\nN20 M99"
    assert ends(f"G65 P9010\nG65 P9010 X0\nG65 P9010 X3.\n{macro}") == [-1, 0, 3]
    macro = "M30\nO9010\nIF [#1 NE #0] THEN X1.\nIF [#0 NE #1] THEN X2.\nX3.\nM99"
    assert ends(f"G65 P9010\nG65 P9010 A1.\n{macro}") == [3, 1, 2, 3]


def test_a_word_of_an_argument_that_was_not_given_counts_for_nothing_and_is_told_once() -> None:
    text = (
        "G65 P9010 X3.\nG65 P9010 L2 Y2.\nM30\nO9010\nG0 X#24 Y#25\nG65 P9011 X#24 Z7.\nM99\n"
        "O9011\nX[#26+1] Z#24\nM99"
    )
    on = replace(reference_interpreter.machine("fanuc"), without_point="unit")
    read = blocks.read(f"G21 G90 G0\n{text}".encode(), on, "p.nc")
    lines = [b.targets[:3] for b in read.blocks if isinstance(b, JointLine)]
    assert lines[0] == (3.0, None, None) and lines[1] == (8.0, None, 3.0)
    assert lines[2:] == [(None, 2.0, None), (8.0, None, None)] * 2
    told = [block.sentence for block in read.blocks if isinstance(block, Remark)]
    assert told == [
        "Y#25 counts for nothing here: #25 is an argument that this macro was not given.",
        "X#24 counts for nothing here: #24 is an argument that this macro was not given.",
        "Z#24 counts for nothing here: #24 is an argument that this macro was not given.",
    ]


@pytest.mark.parametrize("line", ["G0 X#24", "M98 P7", "G65 P9010"])
def test_what_nobody_has_set_is_refused_elsewhere(line: str) -> None:
    with pytest.raises(ProgramError, match="has no value yet"):
        ends(f"{line}\nM30\nO7\nG0 X#24\nM99\nO9010\nG0 X#100\nM99")


def test_g66_calls_behind_every_line_that_moves_until_g67() -> None:
    text = "G66 P9010 A10.\nX1.\nM8\nG4 P100\nY5.\nG1 X2. F100.\nG67\nX3.\nM30\n"
    assert ends(text + "O9010\nX#1\n#1=#1+1.\nM99") == [1, 10, 11, 2, 12, 3]


def test_moves_of_a_modal_macro_and_of_what_it_calls_do_not_call_it() -> None:
    text = "G66 P9010 L2\nX1.\nG67\nM30\nO9010\nX2.\nM98 P7\nM99\nO7\nX3.\nM99"
    assert ends(text) == [1, 2, 3, 2, 3]


def test_moves_of_a_sub_call_the_modal_macro() -> None:
    assert ends("G66 P9010\nM98 P7\nG67\nM30\nO9010\nX2.\nM99\nO7\nX1.\nM99") == [1, 2]


def test_g67_stands_in_any_line() -> None:
    assert ends("G17 G40 G49 G67 G80\nX1.") == [1]
    assert ends("G66 P9010\nX1.\nG67 X3.\nM30\nO9010\nX2.\nM99") == [1, 2, 3]


def test_a_length_without_a_point_counts_as_everywhere_and_a_number_as_it_is() -> None:
    assert shown("G65 P9010 A5000 X1500 D2 S100", 1, 24, 7, 19, without_point="thousandth") == [
        5,
        1.5,
        2,
        100,
    ]
    inches = shown("G20\nG65 P9010 A5000 X1500", 1, 24, without_point="thousandth")
    assert inches == pytest.approx([5 * 25.4, 0.15 * 25.4])
    with pytest.raises(ProgramError, match="1500"):
        shown("G65 P9010 X1500", 24, without_point="")


def test_a_macro_is_found_in_a_file_of_its_number() -> None:
    def find(label: str) -> tuple[str, bytes] | None:
        return ("O9010.nc", b"O9010\nX#1\nM99\n") if label == "9010" else None

    for code in ("G65", "G66"):
        whole = linked.linked(f"G21 G90 G0\n{code} P9010 A4.\nX1.\nM30\n".encode(), find)
        on = replace(reference_interpreter.machine("fanuc"), without_point="unit")
        read = [
            b.targets[0] for b in blocks.read(bytes(whole), on, "p.nc").blocks if isinstance(b, JointLine)
        ]
        assert read == ([4, 1] if code == "G65" else [1, 4])


@pytest.mark.parametrize(
    ("text", "place", "why"),
    [
        ("G65 A1.", "2:1", "G65 calls no macro"),
        ("G66 P1.5", "2:5", "no count"),
        ("G65 P9010 A1. L-1", "2:15", "no count"),
        ("X5. G65 P9010", "2:1", "X5. stands before G65"),
        ("G65 P9010 G1", "2:11", "G is no argument of G65"),
        ("G65 P9010 N5", "2:11", "N is no argument of G65"),
        ("G65 P9010" + " I1." * 11, "2:51", "more than 10 sets"),
        ("G65 P77 A1.", "2:1", "there is no O77"),
        ("G66 P77", "2:1", "there is no O77"),
        ("G66 P9010\nG66 P9010", "3:1", "G66 of line 2 is still on"),
        ("G65 P9010 A#5", "2:11", "#5 has no value yet"),
        ("G65 P9011", "8:3", "call_levels"),
        ("X#0", "2:1", "#0 is what never has a value"),
        ("#0=1", "2:1", "#0 is what never has a value"),
    ],
)
def test_what_is_no_call_is_refused_with_its_place(text: str, place: str, why: str) -> None:
    with pytest.raises(ProgramError) as caught:
        ends(
            f"{text}\nM30\nO9010\nX1.\nM99\nO9011\nN5 G65 P9011\nM99".replace(
                "G65 P9011\nM30", "G65 P9011\n\nM30"
            )
        )
    assert why in caught.value.sentence
    assert place == f"{caught.value.line}:{caught.value.column}" or "call_levels" in why


def test_under_rs274_they_are_refused_with_what_to_write_instead() -> None:
    for code in ("G65", "G66"):
        with pytest.raises(ProgramError, match="O-words"):
            ends(f"{code} P9010\nM30\nO9010\nX1.\nM99", dialect="rs274")
