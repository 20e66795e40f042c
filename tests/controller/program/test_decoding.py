"""Text as it comes: tapes, serial lines, DOS, Windows; and nothing that takes the square of its length."""

from __future__ import annotations

import contextlib
import gc
import random
import time
import tracemalloc
from pathlib import Path

import pytest
from support.machines.traced_programs import mill
from support.oracles import reference_interpreter

from controller.program import blocks, linked, source_text
from controller.program.program import Block, ProgramError, Remark

MILL = mill()
BODY = b"%\nG0 X1.\nX2. (a)\nM30\n%\n"


def read(data: bytes) -> tuple[Block, ...]:
    return blocks.read(data, MILL, "part.ngc").blocks


@pytest.mark.parametrize("before", [b"", bytes(50), b"\x11", b"\x12\r\n\0\0", b"\x7f\0\x11\r\n\r\n", b"\x02"])
@pytest.mark.parametrize(
    "after", [b"", bytes(50), b"\x13", b"\x14\r\n\0", b"\x1a", b"\x1a\x1a\r\n\0\0", b"\x03", b"\r\n\x04\x03"]
)
def test_what_a_tape_or_a_serial_line_leaves_around_a_program_is_no_part_of_it(
    before: bytes, after: bytes
) -> None:
    lines = before.count(b"\n")
    found, plain = read(before + BODY + after), read(BODY)
    assert [type(a) for a in found] == [type(a) for a in plain]
    assert [a.place.line - lines for a in found] == [a.place.line for a in plain]
    assert read(before + BODY.replace(b"%\n", b"") + after)


@pytest.mark.parametrize("byte", [b"\0", b"\x02", b"\x03", b"\x04", b"\x11", b"\x13", b"\x1a", b"\x7f"])
def test_inside_of_a_program_they_are_refused(byte: bytes) -> None:
    with pytest.raises(ProgramError, match=f"control character 0x{byte[0]:02X}") as refused:
        read(b"G0 X1.\nX1" + byte + b"2.\nM30\n")
    assert (refused.value.line, refused.value.column) == (2, 3)


@pytest.mark.parametrize("byte", [b"\x03", b"\x04", b"\x1a"])
def test_behind_the_closing_percent_they_end_all_that_was_sent(byte: bytes) -> None:
    assert read(BODY + b" \r\n" + byte + b" \xff garbage \x01\n") == read(BODY)
    with pytest.raises(ProgramError, match="control character"):
        read(b"%\nG0 X1.\n" + byte + b"\nX2.\n%\n")


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_every_line_end_and_a_byte_order_mark_read_the_same(end: bytes) -> None:
    assert read(b"\xef\xbb\xbf" + BODY.replace(b"\n", end)) == read(BODY)


def test_windows_1252_is_read_and_told_and_refused_outside_of_comments() -> None:
    told, *rest = read(b"G0 X1.\n(\xd8 6 Fr\xe4ser \x80)\nX2.\n")
    assert isinstance(told, Remark) and (told.place.line, told.place.column) == (2, 2)
    assert "0xD8 is not UTF-8, so the file is read as Windows-1252" in told.sentence
    assert [block.place.line for block in rest] == [1, 3]
    assert read("G0 X1. (Fräser)\n".encode()) == read(b"G0 X1. (Fraeser)\n")
    with pytest.raises(ProgramError, match="'\xd8' cannot stand here"):
        read(b"G0 X1.\n\xd86\n")


@pytest.mark.parametrize(
    "line",
    [
        "()",
        "(a)X1",
        "X1 ",
        " ",
        "#1=1 ",
        "X[1+1]",
        "X1X1",
        "X[[1]",
        "/",
        "G1",
        "N1",
        "1",
        "%",
        ";",
        "(",
        "X--",
        "X1O",
    ],
)
def test_a_long_line_takes_time_in_proportion(line: str) -> None:
    """Processor time: sixteen times the length takes far less than 256 times the time."""

    def seconds(count: int) -> float:
        begun = time.process_time()
        with contextlib.suppress(ProgramError):
            read((line * count + "\nM30\n").encode())
        return time.process_time() - begun

    gc.collect()
    gc.disable()  # what other tests left is nothing of this line's
    try:
        most = 0.1 + 64.0 * min(seconds(1_000) for _ in range(2))
        within = any(seconds(16_000) < most for _ in range(2))
    finally:
        gc.enable()
    assert within


def test_lines_come_as_they_stand_however_the_text_is_parted(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = random.Random(5)
    for _ in range(300):
        text = "".join(rng.choice(("\r\n", "\r", "\n", "X1", "é", "")) for _ in range(rng.randrange(30)))
        whole = source_text.NEWLINE.split(text)
        parted = source_text.Text("", memoryview(text.encode()), "utf-8")
        for part in (1, 2, 3, 7, 1000):
            monkeypatch.setattr(source_text, "PART", part)
            assert list(parted.lines()) == whole, (text, part)


@pytest.mark.parametrize(("head", "mapped"), [(b"", True), (b"O1234 (PART)\n", False)])
def test_a_long_program_takes_no_memory_but_its_file(tmp_path: Path, head: bytes, mapped: bool) -> None:
    """That may be mapped; nothing grows with its lines."""
    rows = head + "".join(f"N{i} G1 X{i % 90}.5 Y{i % 70}.25 F800\n" for i in range(30_000)).encode()
    file = tmp_path / "long.ngc"
    file.write_bytes(b"\0\0\r\n%\n" + rows + b"M30\n\x1a")
    on = reference_interpreter.machine()
    data = linked.mapped(file) if mapped else file.read_bytes()
    tracemalloc.start()
    count = sum(1 for _ in blocks.stream(linked.linked(data, linked.among({})), on, "long.ngc"))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert count == 30_001 and peak < 1_000_000


def test_an_empty_file_can_be_mapped(tmp_path: Path) -> None:
    (tmp_path / "empty.ngc").write_bytes(b"")
    assert linked.mapped(tmp_path / "empty.ngc") == b""
