"""What nodes say of themselves: here the temperature, where the machine file says how a drive tells it."""

from __future__ import annotations

import pytest
from support.machines.spindle_machine import mill

from controller import messages
from controller.machine import machine_file
from controller.machine.machine_file import ConfigError
from controller.machine.model import Machine, Temperature
from controller.runtime.bus_load import budgets
from controller.service import node_status
from controller.service.node_status import LastFrames
from controller.state.live_state import blank
from controller.state.modes import Mode
from drives import pdo
from drives.commissioning.wanted import TPDO, axis_pdos

TOLD = "temperature = { index = 0x2035, bits = 16, tpdo = 4, per_degree = 10 }"
NOW = blank()


def warm(line: str = TOLD) -> Machine:
    """X tells its temperature."""
    return mill(changes=(("node = 1\n", f"node = 1\n{line}\n"),))


def test_a_temperature_is_read_from_the_frame_that_brings_it() -> None:
    machine, log = warm(), LastFrames()
    assert machine.axes[0].temperature == Temperature(0x2035, 0, 16, 4, 10.0)
    for tenths in (251, -57):
        log(pdo.frame(pdo.tpdo(4, 1), tenths.to_bytes(2, "little", signed=True)), 1.0)
    rows = node_status.drives(machine, NOW, {machine.axes[0].bus: log})
    assert rows[0]["temperature_c"] == -5.7
    assert "temperature_c" not in rows[1]


@pytest.mark.parametrize(("late_s", "heard"), [(0.0, True), (0.15, True), (60.0, False)])
def test_a_drive_is_heard_until_the_bus_takes_it_for_dead(
    late_s: float, heard: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine, log = warm(), LastFrames()
    monkeypatch.setattr(node_status.time, "time", lambda: 1000.0)
    log(pdo.frame(pdo.HEARTBEAT + 1, b"\x05"), 1000.0 - late_s)
    rows = node_status.drives(machine, NOW, {machine.axes[0].bus: log})
    assert [row["heard"] for row in rows] == [heard, False, False, False, False]


def test_frames_of_a_wrong_length_are_told_of_the_drive_that_sent_them() -> None:
    rows = node_status.drives(warm(), NOW._replace(malformed=(0, 0, 3, 0, 0)), {})
    assert [row["malformed"] for row in rows] == [0, 0, 3, 0, 0]


def test_setpoints_that_did_not_come_are_told_of_each_drive_and_none_of_one_that_does_not_say_it() -> None:
    rows = node_status.drives(warm(), NOW._replace(missed=(0, -1, 7, -1, 0), overdue=(0, 2, 0, 0, 0)), {})
    assert [row["missed_setpoints"] for row in rows] == [0, None, 7, None, 0]
    assert [row["overdue_setpoints"] for row in rows] == [0, 2, 0, 0, 0]


def test_a_drive_that_was_not_heard_yet_has_no_temperature() -> None:
    machine = warm()
    assert node_status.drives(machine, NOW, {})[0]["temperature_c"] is None
    log = LastFrames()
    log(pdo.frame(pdo.tpdo(4, 1), b"\x01"), 1.0)  # too short to be it
    assert node_status.drives(machine, NOW, {machine.axes[0].bus: log})[0]["temperature_c"] is None


@pytest.mark.parametrize(
    ("mode", "homed", "asked", "homes"),
    (
        (Mode.HOMING, 0, (0, 1, 2, 3, 4), "Z"),  # in the shipped file's groups: Z first
        (Mode.HOMING, 0b00100, (0, 1, 2, 3, 4), "XYAC"),
        (Mode.HOMING, 0, (0, 3), "XA"),  # Z was not asked to
        (Mode.HOMING, 0b11110, (0,), "X"),  # anew, alone
        (Mode.OFF, 0, (0, 1, 2, 3, 4), ""),  # between two groups
        (Mode.HOMING, 0b11111, (0, 1), ""),  # done, switching off
    ),
)
def test_only_the_drives_that_home_are_told_to_be_homing(
    mode: Mode, homed: int, asked: tuple[int, ...], homes: str
) -> None:
    machine = machine_file.load("trunnion")
    rows = node_status.drives(machine, NOW._replace(mode=mode, homed=homed), {}, asked)
    assert "".join(row["axis"] for row in rows if row["homing"]) == homes


def test_commissioning_maps_it_and_keeps_it_off_the_bus_while_little_changes() -> None:
    node = machine_file.node_settings(warm())[0]
    (told,) = [one for one in axis_pdos(node) if one.kind is TPDO and one.number == 4]
    assert told.entries == (0x2035_0010,)
    assert (told.event_ms, told.quiet_ms) == (1000, 500)


def test_the_budget_counts_it() -> None:
    before, after = budgets(mill())[0], budgets(warm())[0]
    assert after.background_us > before.background_us
    assert after.total_us == before.total_us  # it is in no tick's way by more than a frame


@pytest.mark.parametrize(
    ("old", "new", "said"),
    (
        ("bits = 16", "bits = 12", "bits = 12: is no size of an object; allowed: 8, 16 or 32"),
        ("tpdo = 4", "tpdo = 9", "tpdo = 9"),
        ("per_degree = 10", "per_degree = 0", "per_degree = 0"),
        ("bits = 16", "bytes = 2", "bytes"),
    ),
)
def test_a_mistake_is_told_with_its_key(old: str, new: str, said: str) -> None:
    with pytest.raises(ConfigError, match="X") as refused:
        warm(TOLD.replace(old, new))
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("code", "words"),
    [(0x8611, "8611h: Schleppfehler"), (0x8619, "8619h: Positionieren"), (0xE123, "E123h: weder in CiA 301")],
)
def test_what_a_drive_reported_is_told_in_any_language_by_its_code_or_its_class(
    code: int, words: str
) -> None:
    machine, log = warm(), LastFrames()
    log(pdo.frame(pdo.EMCY + 1, code.to_bytes(2, "little") + bytes(6)), 1.0)
    rows = node_status.drives(machine, NOW, {machine.axes[0].bus: log})
    assert messages.text(rows[0]["error"], "de").startswith(words) and rows[1]["error"] is None
