"""The serial format: framing, names, parity; identical or refused."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.api import dnc_format as tapes
from controller.api.dnc_format import Reader, Tape, TapeError, punched
from controller.messages import text


def read(data: bytes, even: bool = False, chunk: int = 10**9) -> Tape:
    reader = Reader(even)
    for at in range(0, len(data), chunk):
        if reader.feed(data[at : at + chunk]):
            break
    assert reader.tape is not None, "no end was found"
    return reader.tape


def coded(data: bytes) -> bytes:
    return tapes.coded(data, True)


@pytest.mark.parametrize("chunk", [1, 3, 1000])
@pytest.mark.parametrize("even", [False, True])
def test_leader_and_trailer_are_left_out(even: bool, chunk: int) -> None:
    data = b"\0\0\x7fPART 12\r\n\0\x12%\r\nO1234 (50 % RED)\r\nG1 X1\x7f0 F5\r\n\r\nM30\r\n%\r\n\0\0junk%"
    found = read(coded(data) if even else data, even, chunk)
    assert (found.text, found.name) == (b"O1234 (50 % RED)\nG1 X10 F5\n\nM30\n", "O1234")
    assert [text(said).partition(" within")[0] for said in found.told] == ["line 3: DEL (0x7F)"]


@pytest.mark.parametrize("chunk", [1, 2, 1000])
@pytest.mark.parametrize("even", [False, True])
@pytest.mark.parametrize(
    ("sign", "name"), [(b"\0", "NUL"), (b"\x13", "DC3"), (b"\x7f", "DEL"), (b"\x11", "DC1")]
)
def test_what_is_left_out_within_a_line_is_told_with_its_place(
    even: bool, chunk: int, sign: bytes, name: str
) -> None:
    data = b"%%\r\nO1\r\nG1 X1%s5\r\nG1 X2%s\r\nM30\r\n%%" % (sign, sign)
    found = read(coded(data) if even else data, even, chunk)
    assert found.text == b"O1\nG1 X15\nG1 X2\nM30\n"
    assert [text(said).split(" (")[0] for said in found.told] == [f"line 3: {name}", f"line 4: {name}"]


def test_tape_feed_between_lines_and_around_the_program_is_no_news() -> None:
    feed = b"\0\0\x7f\x13"
    data = feed + b"%" + feed + b"\r\n" + feed + b"O1\r" + feed + b"\n" + feed + b"M30\n" + feed + b"%" + feed
    assert read(data).told == ()


def test_a_line_of_nothing_but_noise_does_not_fill_the_memory_with_places() -> None:
    found = read(b"%\nO1\nG1" + b" \0" * 100_000 + b"X1\nM30\n%", chunk=4096)
    assert len(found.told) == tapes.MAX_TOLD + 1 and text(found.told[-1]).startswith("More of these than 20")


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (b"O1\nM30\nO2\nG1\nM99\n:3 (LID)\nM2\n", ["O1", "O2", "O3"]),
        (b"O1\nG1\nO77\nM30\n", ["O1"]),  # a number in the midst is a block of the program
        (b"O1\nM30 (O2)\n\n", ["O1"]),
        (b"O1\n(M30)\nO2\nM30\n", ["O1"]),
        (b"O1\nM3 S100\nO2 M300\nM30\n", ["O1"]),
        (b"G1\nN90 M30\n\nO2\nM30\n", ["", "O2"]),
    ],
)
def test_programs_of_one_tape_are_told_apart_by_their_numbers(text: bytes, names: list[str]) -> None:
    found = tapes.programs(read(b"%\n" + text + b"%"))
    assert [one.name for one in found] == names
    assert b"".join(one.text for one in found) == text


def test_two_programs_of_one_number_are_refused_by_it() -> None:
    with pytest.raises(TapeError, match="O1 stands on the tape twice"):
        tapes.programs(read(b"%\nO1\nM30\nO1\nM30\n%"))


def test_what_was_punched_here_stays_one_program_whatever_it_holds() -> None:
    text = b"O1\nM30\nO2\nM30\n"
    (found,) = tapes.programs(read(punched(text, False)))
    assert found.text == text


@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_what_follows_the_end_is_not_of_this_tape_and_is_kept_as_it_came(chunk: int) -> None:
    first, second = coded(b"%\nO1\nM30\n%"), coded(b"\r\n%\nO2 (5 % OF IT)\nM30\n%\0")
    reader, at = Reader(True), 0
    while not reader.feed((first + second)[at : at + chunk]):
        at += chunk
    rest = reader.rest + (first + second)[at + chunk :]
    assert rest == second and read(rest, True).name == "O2"


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (b"%\nO1234\nM30\n%", "O1234"),
        (b"%\n:0777(LID)\nM30\n%", "O0777"),
        (b"%\n\n o 12 \nM30\n%", "O12"),
        (b"%O5\nM30\n%", "O5"),
        (b"%:6 (X)\nM30\n%", "O6"),
        (b"% TEST\nG0 X1\nM30\n%", ""),
        (b"%\nG0 X1\nO12\nM30\n%", ""),
        (b"%\nO12.5\nM30\n%", ""),
        (b"%\nM30%", ""),
    ],
)
def test_the_number_names_the_program(text: bytes, name: str) -> None:
    assert read(text).name == name


@pytest.mark.parametrize("end", [b"\n", b"\r", b"\r\n", b"\n\r\r"])
def test_every_kind_of_line_end_becomes_a_line_end(end: bytes) -> None:
    assert read(end.join([b"%", b"O1", b"", b"M30", b"%", b""])).text == b"O1\n\nM30\n"


@pytest.mark.parametrize("data", [b"%\n%", b"%\n \n%\n", b"%%"])
def test_an_empty_tape_is_refused(data: bytes) -> None:
    with pytest.raises(TapeError, match="nothing stands between"):
        read(data)


def test_a_flipped_bit_is_found_and_its_line_is_named() -> None:
    data = bytearray(coded(b"%\nO1\nG1 X1\nM30\n%\n"))
    data[8] ^= 0x10
    with pytest.raises(TapeError, match=r"line 3: a byte .* has the wrong parity"):
        read(bytes(data), True)


def test_seven_bits_taken_for_eight_are_refused_with_the_remedy() -> None:
    with pytest.raises(TapeError, match="use the format 7E2 or 7E1"):
        read(b"%\n" + coded(b"G1 X10 Y7\nM30\n") + b"%\n")


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (b"", "nothing stands"),
        (b"G0 X1\x08\n", "0x08 is a control"),
        (b"G0\n\xff\n", "line 2: byte 0xFF is no text"),
        (b"G0 X1 %\nG1\n", "line 1: % stands where"),
        (b"%\nG0\n%\nG1\n", "% stands where"),
    ],
)
def test_what_could_not_be_read_back_is_not_sent(text: bytes, what: str) -> None:
    with pytest.raises(TapeError, match=what):
        punched(text, False)


def test_a_letter_that_needs_eight_bits_is_not_sent_through_seven() -> None:
    with pytest.raises(TapeError, match=r"line 2: byte 0xC3 does not go through 7 bits"):
        punched("G0\n(für)\n".encode(), True)
    assert read(punched("G0\n(für)\n".encode(), False)).text == "G0\n(für)\n".encode()


LINES = st.sampled_from(
    ["G1 X1 F5", "", "(50 % OF IT)", "; 100 % sure", "O77", "M30", "  ", "(open % ", "N5 #1=[2]"]
)
ENDS = st.sampled_from(["\n", "\r\n", "\r"])
PROGRAMS = st.tuples(
    st.booleans(),
    st.lists(st.tuples(LINES, ENDS), min_size=1, max_size=8),
    st.sampled_from(["", "M2", "\n", "\r\n"]),
)


@given(PROGRAMS, st.booleans(), st.integers(1, 50))
def test_a_program_punched_out_reads_back_identical(
    drawn: tuple[bool, list[tuple[str, str]], str], even: bool, chunk: int
) -> None:
    framed, lines, last = drawn
    body = "G0" + "".join(line + end for line, end in lines)
    text = f"%\n{body}\n%{last.replace('M2', '')}" if framed else body + last
    assert read(punched(text.encode(), even), even, chunk).text == text.encode()


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r", b"\n\r\r"])
def test_a_program_sent_with_other_line_ends_reads_back_identical(end: bytes) -> None:
    text = b"O1\nG1 X1\n\nM30\n"
    data = punched(text, True, end)
    assert read(data, True).text == text
    assert coded(end + b"%") in data


def test_lost_characters_are_found_on_a_line_without_parity() -> None:
    draw = random.Random(4)
    text = b"O1\n" + b"G1 X1.25 Y-3.5\n" * 50 + b"M30\n"
    data = punched(text, False)
    for _ in range(300):
        at = draw.randrange(tapes.LEADER + 100, len(data) - tapes.LEADER - 3)
        try:
            found = read(data[:at] + data[at + draw.randrange(1, 4) :])
        except (TapeError, AssertionError):
            continue
        assert found.text == text


@given(st.binary(max_size=300), st.booleans())
def test_any_bytes_are_a_program_or_refused(data: bytes, even: bool) -> None:
    reader = Reader(even, most_bytes=200)
    try:
        reader.feed(b"%\n" + data)
        reader.feed(data + b"%")
    except TapeError as error:
        assert str(error).isprintable()
