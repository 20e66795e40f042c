"""G38.2 to G38.5 and G31 as the reader has them; how they run is ``acceptance/test_probing``."""

from __future__ import annotations

import pytest
from support.machines import probing_machine

from controller.program import blocks
from controller.program.program import JointLine, Probed, ProgramError, TipLine

HEAD = "G21 G90\nT99 M6\nG43 H99\nG0 Z20.\n"


def made(text: str, dialect: str = "rs274") -> list[JointLine | TipLine]:
    machine = probing_machine.machine(**{'name = "trunnion"': f'name = "trunnion"\ndialect = "{dialect}"'})
    read = blocks.read((HEAD + text).encode(), machine, "probe.ngc")
    return [one for one in read.blocks if isinstance(one, JointLine | TipLine)]


@pytest.mark.parametrize(
    ("code", "dialect", "away", "must"),
    [
        ("G38.2", "rs274", False, True),
        ("G38.3", "rs274", False, False),
        ("G38.4", "rs274", True, True),
        ("G38.5", "rs274", True, False),
        ("G31", "fanuc", False, False),
    ],
)
def test_each_code_says_what_it_waits_for_and_whether_it_must_come(
    code: str, dialect: str, away: bool, must: bool
) -> None:
    probe = made(f"{code} Z-10. F50.\n", dialect)[-1].probe
    assert probe is not None
    assert (probe.code, probe.away, probe.must, probe.came) == (code, away, must, None)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("G38.2 A10. F50.", "rotaries stand"),
        ("G38.2 F50.", "has no way"),
        ("G93 G38.2 Z-10. F5.", "G94"),
        ("S100 M3\nG38.2 Z-10. F50.", "must not turn"),
        ("G38.2 Z-10. F50.\nZ-20.", "each probing move names its code"),
        ("G38.2 Z-10. F50.\nG1 A#5064x", ""),
    ],
)
def test_what_cannot_be_probed_is_refused_with_its_reason(text: str, word: str) -> None:
    with pytest.raises(ProgramError) as refused:
        made(text + "\n")
    assert word in str(refused.value)


@pytest.mark.parametrize("signal", ["P1", "P4", "R0", "R1"])
def test_a_skip_signal_chooses_nothing(signal: str) -> None:
    probe = made(f"G91 G31 Z-10. F50. {signal}\n", "fanuc")[-1].probe
    assert probe is not None and probe.code == "G31"


@pytest.mark.parametrize("signal", ["P98", "P99", "P0", "R2", "P1.5"])
def test_what_is_no_skip_signal_is_refused(signal: str) -> None:
    with pytest.raises(ProgramError, match=f"{signal} of G31"):
        made(f"G31 Z-10. F50. {signal}\n", "fanuc")


def test_a_tool_that_is_no_probe_has_no_probing_without_a_setter() -> None:
    machine = probing_machine.machine(**{probing_machine.SETTER: ""})
    with pytest.raises(ProgramError, match="its probe is T99"):
        blocks.read(b"T1 M6\nG38.2 Z-10 F50\n", machine, "probe.ngc")


def test_the_reader_goes_on_from_where_the_axes_are() -> None:
    machine = probing_machine.machine()
    text = HEAD + "G38.3 Z-10. F50.\nG1 X[#5063] Y[#5070] F100.\nG91 G1 Z1.\nG90 G1 Z[#5422]\n"
    read = blocks.stream(text.encode(), machine, "probe.ngc")
    for block in read:
        if isinstance(block, JointLine) and block.probe is not None:
            block.probe.came = Probed(True, (8.0, 96.0, 183.5, 0.0, 0.0), (8.0, 96.0, 183.0, 0.0, 0.0))
            break
    line, up, last = (one for one in read if isinstance(one, JointLine))
    assert line.targets[:2] == pytest.approx((8.0 + 3.5 - 8.0, 1.0))
    assert up.relative
    assert last.targets[2] == pytest.approx(4.0)


def test_what_a_program_says_of_the_touch_holds_until_the_next_probing_move() -> None:
    """As LinuxCNC: loops that probe until nothing touches begin with it."""
    machine = probing_machine.machine()
    text = HEAD + "#5070=7\n#5063=3\nG1 X#5070 Z#5063 F100.\nG38.3 Z-10. F50.\nG1 X#5070 Y#5063 F100.\n"
    *_, before, _, behind = (
        one for one in blocks.stream(text.encode(), machine, "probe.ngc") if isinstance(one, JointLine)
    )
    assert before.targets[0] == 7.0
    assert behind.targets[:2] == pytest.approx((1.0, -10.0))


def test_a_check_takes_the_end_of_the_line_for_the_touch() -> None:
    line = made("G38.2 Z-10. F50.\nG1 X[#5063] F100.\n")[-1]
    assert line.targets[0] == -10.0
