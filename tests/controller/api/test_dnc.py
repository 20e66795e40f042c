"""Serial transfer over a pseudo terminal: what arrives is identical, or refused and not kept."""

from __future__ import annotations

import contextlib
import hashlib
import json
import random
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.drives.serial_pty import Pty
from support.suite.seed import SEED
from typer.testing import CliRunner

from controller import messages
from controller.api import dnc, dnc_format
from controller.api.dnc import LineSettings, Unmarked
from controller.api.dnc_format import TapeError
from controller.api.store import Store
from controller.cli import dnc as command

FORMATS = ["7E2", "7E1", "8N1"]
HARMS = ["none", "bit", "lost", "cut"]
BITS_A_BYTE = 11
Write = Callable[[bytes], None]


def program(size: int, seed: int = 1) -> bytes:
    draw, text = random.Random(seed), bytearray(b"O4711 (PART)\n")
    while len(text) < size:
        x, y, feed = draw.uniform(-99, 99), draw.uniform(-99, 99), draw.randrange(9)
        text += b"G1 X%.3f Y%.3f F%d\n" % (x, y, feed)
    return bytes(text + b"M30\n")


@pytest.fixture
def pty() -> Iterator[Pty]:
    made = Pty()
    yield made
    made.close()


def settings(pty: Pty, data_format: str = "7E2", flow: str = "xon", silence_s: float = 20.0) -> LineSettings:
    return LineSettings(pty.path, 115200, data_format, flow, silence_s, wait_s=20.0)


def awaited(pty: Pty, character: bytes, even: bool = True) -> None:
    """Wait for what the receiver sends when its port is open."""
    found = b""
    while dnc_format.coded(character, even) not in found:
        found += pty.read(20.0)


@contextlib.contextmanager
def machine(pty: Pty, work: Callable[[], None]) -> Iterator[None]:
    """The other end, at work in a thread; after a failure of ours it need not go on."""
    failed: list[BaseException] = []

    def guarded() -> None:
        try:
            work()
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=guarded)
    thread.start()
    try:
        yield
    except BaseException:
        pty.ended.set()
        raise
    finally:
        thread.join(300.0)
    assert not thread.is_alive()
    if failed:
        raise failed[0]


def received(pty: Pty, used: LineSettings, send: Callable[[], None]) -> dnc_format.Tape:
    """The one program that came."""
    came = all_received(pty, used, send)
    assert len(came.tapes) == 1 and not came.problem, came
    return came.tapes[0]


def all_received(pty: Pty, used: LineSettings, send: Callable[[], None]) -> dnc.Received:
    def work() -> None:
        awaited(pty, dnc_format.DC1, used.even_parity)
        send()

    with machine(pty, work), dnc.opened(used) as line:
        return dnc.receive(line)


@pytest.mark.parametrize("data_format", FORMATS)
def test_a_program_comes_in_whole(pty: Pty, data_format: str) -> None:
    text = program(20_000)
    data = dnc_format.punched(text, data_format != "8N1")
    found = received(pty, settings(pty, data_format), lambda: pty.write(data))
    assert (found.text, found.name) == (text, "O4711")


SECOND = b"\0\0\r\n%\r\nO2 (5 % OF IT)\r\nG1 X2\r\nM30\r\n%\r\n\0\0"


@pytest.mark.parametrize("data_format", FORMATS)
def test_a_second_program_in_the_stream_comes_in_by_its_own_number(pty: Pty, data_format: str) -> None:
    even = data_format != "8N1"
    data = dnc_format.punched(program(3_000), even) + dnc_format.coded(SECOND, even)
    came = all_received(pty, settings(pty, data_format), lambda: pty.write(data))
    assert [(one.name, one.text) for one in came.tapes] == [
        ("O4711", program(3_000)),
        ("O2", b"O2 (5 % OF IT)\nG1 X2\nM30\n"),
    ]
    assert not came.problem


@pytest.mark.parametrize("harm", ["cut", "bit"])
def test_a_second_program_that_is_not_whole_is_told_and_the_first_is_kept(pty: Pty, harm: str) -> None:
    second = bytearray(dnc_format.coded(SECOND, True))
    if harm == "cut":
        del second[25:]
    else:
        second[20] ^= 4
    data = dnc_format.punched(program(3_000), True) + bytes(second)
    came = all_received(pty, settings(pty, silence_s=2.0), lambda: pty.write(data))
    assert [one.text for one in came.tapes] == [program(3_000)]
    problem = messages.text(came.problem)
    assert problem.startswith("Behind O4711 another program began, of which nothing was kept: ")
    assert ("silent" if harm == "cut" else "wrong parity") in problem


@pytest.mark.parametrize("trailer", [b"", b"\r\n%\r\n", b"END OF TAPE\r\n", b"\0" * 500 + b"\x7f%"])
def test_a_trailer_is_no_second_program(pty: Pty, trailer: bytes) -> None:
    data = dnc_format.punched(program(500), True) + dnc_format.coded(trailer, True)
    assert received(pty, settings(pty), lambda: pty.write(data)).text == program(500)


def test_a_sender_that_is_gone_after_its_program_has_sent_it(pty: Pty) -> None:
    def send() -> None:
        pty.write(dnc_format.punched(program(500), True))
        pty.drained()
        pty.cut()

    assert received(pty, settings(pty), send).text == program(500)


@pytest.mark.parametrize("data_format", FORMATS)
def test_a_foreign_tape_comes_in_by_its_number(pty: Pty, data_format: str) -> None:
    data = b"\0" * 50 + b"\r\n%\r\n:0042(RED)\r\nG1 X1\r\nM30\r\n%\r\n" + b"\0" * 50
    coded = dnc_format.coded(data, data_format != "8N1")
    found = received(pty, settings(pty, data_format), lambda: pty.write(coded))
    assert found == dnc_format.Tape(b":0042(RED)\nG1 X1\nM30\n", "O0042")


def test_a_parity_error_ends_the_transfer(pty: Pty) -> None:
    data = bytearray(dnc_format.punched(program(5_000), True))
    data[3_000] ^= 0x04
    with pytest.raises(TapeError, match="wrong parity"):
        received(pty, settings(pty), lambda: pty.write(bytes(data)))


def test_a_line_that_falls_silent_ends_the_transfer(pty: Pty) -> None:
    data = dnc_format.punched(program(5_000), True)[:3_000]
    with pytest.raises(TapeError, match=r"line \d+: the line was silent"):
        received(pty, settings(pty, silence_s=0.3), lambda: pty.write(data))


def test_a_line_that_is_cut_ends_the_transfer(pty: Pty) -> None:
    def send() -> None:
        pty.write(dnc_format.punched(program(5_000), True)[:3_000])
        pty.drained()
        pty.cut()

    with pytest.raises(TapeError, match="the line failed"):
        received(pty, settings(pty), send)


def test_nobody_sends_anything(pty: Pty) -> None:
    used = LineSettings(pty.path, silence_s=0.1, wait_s=0.3)
    with pytest.raises(TapeError, match="no program began"), dnc.opened(used) as line:
        dnc.receive(line)


def test_the_receiver_starts_the_sender_and_stops_it_at_the_end(pty: Pty) -> None:
    received(pty, settings(pty, "8N1"), lambda: pty.write(b"%\nM30\n%"))
    assert pty.read() == dnc_format.DC3


def test_a_port_that_is_not_there_or_set_wrong_is_refused() -> None:
    for used, what in [
        (LineSettings("/dev/nothing"), "the line failed"),
        (LineSettings("/dev/null"), "the line failed"),
        (LineSettings("/dev/null", baud=31250), "baud 31250 is not known"),
        (LineSettings("/dev/null", format="7O1"), "format 7O1 is not known"),
        (LineSettings("/dev/null", flow="both"), "flow both is not known"),
    ]:
        with pytest.raises(TapeError, match=what), dnc.opened(used):
            pass


# ---- sending


def storm(pty: Pty, draw: random.Random, even: bool, size: int, storms: int) -> bytes:
    """Read a tape of ``size`` bytes, and stop the sender at random; it must stop, and go on."""
    found = bytearray()
    stops = sorted(draw.randrange(size) for _ in range(storms))
    while len(found) < size:
        got = pty.read(20.0)
        if not got:
            break
        found += got
        if stops and len(found) >= stops[0]:
            stops.pop(0)
            for _ in range(draw.randrange(1, 4)):
                pty.write(dnc_format.coded(dnc_format.DC3, even))
            while more := pty.read(0.02):  # what was on its way
                found += more
            assert pty.read(0.02) == b"", "the sender went on after XOFF"
            pty.write(dnc_format.coded(dnc_format.DC1, even) * draw.randrange(1, 3))
    return bytes(found)


def sent(pty: Pty, used: LineSettings, data: bytes, storms: int, seed: int = 3) -> bytes:
    """What the machine got of a tape."""
    found: list[bytes] = []
    size = len(data) + 2  # DC2 and DC4
    work = lambda: found.append(storm(pty, random.Random(seed), used.even_parity, size, storms))  # noqa: E731
    with machine(pty, work), dnc.opened(used) as line:
        dnc.send(line, data)
    return found[0]


@pytest.mark.parametrize("data_format", FORMATS)
def test_a_sender_obeys_xoff_and_sends_everything(pty: Pty, data_format: str) -> None:
    used, text = settings(pty, data_format), program(40_000)
    data = dnc_format.punched(text, used.even_parity)
    found = sent(pty, used, data, storms=10)
    even = used.even_parity
    assert found == dnc_format.coded(dnc_format.DC2, even) + data + dnc_format.coded(dnc_format.DC4, even)
    reader = dnc_format.Reader(even)
    assert reader.feed(found)
    assert reader.tape is not None and reader.tape.text == text


def test_a_reader_that_stays_stopped_ends_the_transfer(pty: Pty) -> None:
    def work() -> None:
        pty.read(10.0)
        pty.write(dnc_format.coded(dnc_format.DC3, True))

    with (
        machine(pty, work),
        pytest.raises(TapeError, match="has not taken anything"),
        dnc.opened(settings(pty, silence_s=0.3)) as line,
    ):
        dnc.send(line, dnc_format.punched(program(200_000), True))


def test_a_sender_can_wait_for_the_reader(pty: Pty) -> None:
    data, found = dnc_format.punched(program(2_000), True), bytearray()

    def work() -> None:
        found.extend(pty.read(0.3))
        assert not found, "it began before it was asked"
        while not found:  # a line that is only being opened forgets what has come
            pty.write(dnc_format.coded(dnc_format.DC1, True))
            found.extend(pty.read())
        while len(found) < len(data) + 2:
            found.extend(pty.read(20.0))

    with machine(pty, work), dnc.opened(settings(pty)) as line:
        dnc.send(line, data, await_start=True)
    assert bytes(found[1:-1]) == data


# ---- what the kernel marks


def test_marks_of_broken_bytes_are_refused_and_others_taken_out() -> None:
    for cut in range(7):
        unmarked = Unmarked("port")
        data = b"a\xff\xff\xff\xffb"
        assert unmarked.plain(data[:cut]) + unmarked.plain(data[cut:]) == b"a\xff\xffb"
    for broken in (b"G1\xff\x00X", b"\xff\x00\x00"):
        with pytest.raises(TapeError, match="without its stop bit"):
            Unmarked("port").plain(broken)


def test_the_kernel_paces_by_the_characters_as_they_are_on_the_wire(pty: Pty) -> None:
    with dnc.opened(settings(pty)) as line:
        control = termios.tcgetattr(line.port.fileno())
    assert (control[6][termios.VSTART], control[6][termios.VSTOP]) == (b"\x11", b"\x93")
    assert control[0] & termios.IXON and control[0] & termios.IXOFF


# ---- the command, and the store


def run(*words: str) -> tuple[int, dict[str, object]]:
    done = CliRunner().invoke(command.app, [*words, "--json"])
    return done.exit_code, json.loads(done.stdout)


def test_a_received_program_stands_in_the_store_and_reads_back_identical(pty: Pty, tmp_path: Path) -> None:
    text = b"%\r\nO12 (OWN FRAME)\r\nG1 X1 F100\r\nM30\r\n%\r\n"
    data = dnc_format.punched(text, True)
    line = ("--port", pty.path, "--baud", "115200", "--state", str(tmp_path), "--silence-s", "20")

    def machine_sends() -> None:
        awaited(pty, dnc_format.DC1)
        pty.write(data)
        awaited(pty, dnc_format.DC3)

    with machine(pty, machine_sends):
        code, facts = run("receive", *line)
    assert code == 0 and facts["program"] == "O12"
    assert facts["sha256"] == hashlib.sha256(text).hexdigest()
    found: list[bytes] = []
    with machine(pty, lambda: found.append(storm(pty, random.Random(1), True, len(data) + 2, 2))):
        code, _ = run("send", "O12", *line)
    assert code == 0
    assert found[0][1:-1] == data


def sent_and_taken(pty: Pty, data: bytes, state: Path, *words: str) -> tuple[int, list[dict[str, object]]]:
    """Exit code, and what was told of each program."""

    def machine_sends() -> None:
        awaited(pty, dnc_format.DC1)
        pty.write(dnc_format.coded(data, True))

    with machine(pty, machine_sends):
        line = ("--port", pty.path, "--baud", "115200", "--state", str(state), "--silence-s", "1")
        done = CliRunner().invoke(command.app, ["receive", *line, *words, "--json"])
    return done.exit_code, [json.loads(said) for said in done.stdout.splitlines()]


def test_every_program_of_a_transmission_is_stored_by_its_number_and_what_was_left_out_is_told(
    pty: Pty, tmp_path: Path
) -> None:
    data = b"%\r\nO1\r\nG1 X1\x005\r\nM30\r\nO7\r\nM30\r\n%\r\n" + SECOND
    code, told = sent_and_taken(pty, data, tmp_path)
    assert code == 0 and [one["program"] for one in told] == ["O1", "O7", "O2"]
    assert [len(one.get("left_out", [])) for one in told] == [1, 0, 0]  # type: ignore[arg-type]
    assert "line 3: NUL (0x00) within the line" in str(told[0]["left_out"])
    store = Store(tmp_path)
    assert store.programs.path(store.programs.get("O1").sha256).read_bytes() == b"O1\nG1 X15\nM30\n"


def test_several_programs_are_not_stored_under_one_name(pty: Pty, tmp_path: Path) -> None:
    code, told = sent_and_taken(pty, b"%\r\nO1\r\nM30\r\n%\r\n" + SECOND, tmp_path, "--name", "x")
    assert code == 1 and "2 programs came (O1, O2), and --name names one" in str(told[0]["error"])
    assert Store(tmp_path).programs.list() == []


def test_a_transfer_with_an_error_keeps_nothing(pty: Pty, tmp_path: Path) -> None:
    data = bytearray(dnc_format.punched(program(2_000), True))
    data[500] ^= 1

    def machine_sends() -> None:
        awaited(pty, dnc_format.DC1)
        pty.write(bytes(data))

    with machine(pty, machine_sends):
        code, facts = run("receive", "--port", pty.path, "--state", str(tmp_path), "--silence-s", "1")
    assert code == 1 and "wrong parity" in str(facts["error"])
    store = Store(tmp_path)
    assert store.programs.list() == []
    assert [p.name for p in store.programs.folder.iterdir()] == [".incoming"]


def test_what_cannot_be_sent_is_refused_before_the_line_is_opened(tmp_path: Path) -> None:
    code, facts = run("send", "nothing", "--port", "/dev/null", "--state", str(tmp_path))
    assert code == 1 and "no such program" in str(facts["error"])
    (tmp_path / "own.ngc").write_bytes("G0 (für)\n".encode())
    code, facts = run("send", str(tmp_path / "own.ngc"), "--file", "--port", "/dev/null")
    assert code == 1 and "does not go through 7 bits" in str(facts["error"])


# ---- a megabyte


def wild(pty: Pty, data: bytes, draw: random.Random, even: bool, paced: bool) -> None:
    """Send as a machine does at 115200: in bursts, with XON and XOFF and NULs strewn in."""
    awaited(pty, dnc_format.DC1, even)
    began_s, at = time.monotonic(), 0
    while at < len(data):
        size = draw.randrange(1, 4000)
        pty.write(data[at : at + size])
        at += size
        if draw.random() < 0.2:
            pty.write(
                dnc_format.coded(
                    draw.choice(
                        [dnc_format.DC1, dnc_format.DC3 + dnc_format.DC1, dnc_format.NUL, dnc_format.DEL]
                    ),
                    even,
                )
            )
        if paced:
            time.sleep(max(0.0, at * BITS_A_BYTE / 115200 - (time.monotonic() - began_s)))


def arrives_or_is_refused(
    pty: Pty, data_format: str, harm: str, text: bytes, draw: random.Random, paced: bool = False
) -> None:
    """Identical where nothing was wrong, and else there is nothing."""
    used = settings(pty, data_format, silence_s=2.0)
    data = bytearray(dnc_format.punched(text, used.even_parity))
    at = draw.randrange(200, len(data) - 200)
    if harm == "bit":
        data[at] ^= 1 << draw.randrange(8)
    elif harm == "lost":
        del data[at : at + 3]
    elif harm == "cut":
        del data[at:]
    outcome: dnc_format.Tape | None = None
    with contextlib.suppress(TapeError):
        outcome = received(pty, used, lambda: wild(pty, bytes(data), draw, used.even_parity, paced))
    assert (outcome.text if outcome else None) == (text if harm == "none" else None)


@pytest.mark.slow
@pytest.mark.parametrize("harm", HARMS)
def test_some_of_a_tape_arrives_identical_or_is_refused_each_time_with_another_harm(
    pty: Pty, harm: str
) -> None:
    print(f"seed {SEED}")
    draw = random.Random(f"{SEED} {harm}")
    arrives_or_is_refused(pty, draw.choice(FORMATS), harm, program(150_000, SEED), draw)


@pytest.mark.slow
def test_some_of_a_tape_is_punched_through_xoff_storms(pty: Pty) -> None:
    print(f"seed {SEED}")
    used, text = settings(pty, random.Random(SEED).choice(FORMATS)), program(150_000, SEED)
    found = sent(pty, used, dnc_format.punched(text, used.even_parity), storms=25, seed=SEED)
    reader = dnc_format.Reader(used.even_parity)
    assert reader.feed(found) and reader.tape is not None and reader.tape.text == text


@pytest.mark.soak
@pytest.mark.parametrize("data_format", FORMATS)
@pytest.mark.parametrize("harm", HARMS)
def test_a_megabyte_at_115200_arrives_identical_or_is_refused(pty: Pty, data_format: str, harm: str) -> None:
    paced = harm == "none" and data_format == "7E2"  # 95 s; the pace of the others is the pty's
    arrives_or_is_refused(pty, data_format, harm, program(1_000_000), random.Random(7), paced)


@pytest.mark.soak
@pytest.mark.parametrize("data_format", FORMATS)
def test_a_megabyte_is_punched_through_xoff_storms(pty: Pty, data_format: str) -> None:
    used, text = settings(pty, data_format), program(1_000_000)
    found = sent(pty, used, dnc_format.punched(text, used.even_parity), storms=150)
    reader = dnc_format.Reader(used.even_parity)
    assert reader.feed(found) and reader.tape is not None and reader.tape.text == text
