"""A handwheel or gamepad: its events as the kernel writes them, into what it asks for."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from controller.ipc.control_socket import CommandRefused
from controller.machine.toml_table import ConfigError
from controller.service import pendant
from controller.service.pendant import ABS, CODES, DROPPED, EVENT, KEY, REL, SYN, Hand, Pendant

AXES = ("X", "Y", "Z", "A", "C")
TEXT = """
device = "/dev/input/event0"
dead_man = "BTN_TL"
speed = 0.5
[sticks]
ABS_X = "X"
ABS_Y = "-Y"
[wheel]
event = "REL_DIAL"
step = 0.01
[wheel.axes]
BTN_SOUTH = "X"
BTN_EAST = "Z"
[buttons]
BTN_START = "hold"
"""
END = 32767


class Machine:
    """Takes what it is asked for, or refuses it."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, dict[str, Any]]] = []
        self.mode, self.refuses = "READY", ""

    def ask(self, verb: str, **args: Any) -> dict[str, Any]:
        self.asked.append((verb, args))
        if verb == self.refuses:
            raise CommandRefused("refused", "No.")
        return {"mode": self.mode}

    @property
    def verbs(self) -> list[str]:
        return [verb for verb, _ in self.asked if verb != "status"]


@pytest.fixture
def settings(tmp_path: Path) -> pendant.Settings:
    file = tmp_path / "pendant.toml"
    file.write_text(TEXT)
    return pendant.read(file, AXES)


@pytest.fixture
def machine() -> Machine:
    return Machine()


@pytest.fixture
def device(settings: pendant.Settings, machine: Machine) -> Pendant:
    return Pendant(Hand(settings, {}), machine)


def press(device: Pendant, name: str, value: int = 1) -> None:
    device.feel(KEY, CODES[name], value)


def test_without_the_dead_mans_switch_nothing_moves(device: Pendant, machine: Machine) -> None:
    device.feel(ABS, CODES["ABS_X"], END)
    device.feel(REL, CODES["REL_DIAL"], 5)
    device.turn()
    press(device, "BTN_TL", 2)  # it repeats itself: nobody has pressed it
    device.turn()
    assert machine.verbs == []
    press(device, "BTN_TL")
    device.turn()
    assert machine.asked[-1][0] == "jog" and machine.asked[-1][1]["axis"] == "X"
    assert machine.asked[-1][1]["speed"] == pytest.approx(0.5)


def test_the_switch_that_goes_up_stops_at_once_and_by_name(device: Pendant, machine: Machine) -> None:
    press(device, "BTN_TL")
    device.feel(ABS, CODES["ABS_Y"], END)
    device.turn()
    device.turn()
    presses = {args["press"] for verb, args in machine.asked if verb == "jog"}
    assert len(presses) == 1 and machine.asked[0][1]["speed"] == pytest.approx(-0.5)
    press(device, "BTN_TL", 0)
    assert machine.asked[-1] == ("jog_stop", {"press": presses.pop()})
    device.turn()
    assert machine.verbs[-1] == "jog_stop"


def test_another_press_has_another_name(device: Pendant, machine: Machine) -> None:
    for value in (1, 0, 1):
        press(device, "BTN_TL", value)
        device.feel(ABS, CODES["ABS_X"], END)
        device.turn()
    names = [args["press"] for verb, args in machine.asked if verb == "jog"]
    assert len(set(names)) == 2


@pytest.mark.parametrize("value", [0, 3000, -4000])
def test_a_stick_near_its_middle_is_at_rest(value: int, device: Pendant, machine: Machine) -> None:
    press(device, "BTN_TL")
    device.feel(ABS, CODES["ABS_X"], END)
    device.turn()
    device.feel(ABS, CODES["ABS_X"], value)
    device.turn()
    assert machine.verbs == ["jog", "jog_stop"]


def test_lost_events_count_as_a_switch_that_went_up(device: Pendant, machine: Machine) -> None:
    press(device, "BTN_TL")
    device.feel(ABS, CODES["ABS_X"], END)
    device.turn()
    device.feel(SYN, DROPPED, 0)
    device.turn()
    assert machine.verbs == ["jog", "jog_stop"]


def test_what_is_refused_does_not_begin_by_itself_later(device: Pendant, machine: Machine) -> None:
    machine.refuses = "jog"
    press(device, "BTN_TL")
    device.feel(ABS, CODES["ABS_X"], END)
    device.turn()
    machine.refuses = ""
    device.turn()
    assert machine.verbs == ["jog", "jog_stop"]
    press(device, "BTN_TL", 0)
    press(device, "BTN_TL")
    device.turn()
    assert machine.verbs[-1] == "jog"


def test_a_wheel_loses_no_detent_while_a_step_is_under_way(device: Pendant, machine: Machine) -> None:
    press(device, "BTN_TL")
    press(device, "BTN_EAST")
    device.feel(REL, CODES["REL_DIAL"], 3)
    device.turn()
    machine.mode = "JOG"
    for _ in range(4):
        device.feel(REL, CODES["REL_DIAL"], -2)
        device.turn()
    machine.mode = "READY"
    device.turn()
    steps = [(args["axis"], args["distance"]) for verb, args in machine.asked if verb == "jog_step"]
    assert steps == [("Z", pytest.approx(0.03)), ("Z", pytest.approx(-0.08))]


def test_a_button_holds_without_the_switch(device: Pendant, machine: Machine) -> None:
    press(device, "BTN_START")
    press(device, "BTN_START", 0)
    assert machine.verbs == ["hold"]


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    reading, writing = os.pipe()
    yield reading, writing
    os.close(reading)


def test_a_device_that_is_pulled_out_stops_what_moves(
    settings: pendant.Settings, machine: Machine, pipe: tuple[int, int]
) -> None:
    """Events as the kernel writes them, several in one read; a half one is none."""
    reading, writing = pipe
    thread = threading.Thread(target=pendant.follow, args=(reading, settings, machine, lambda: False))
    thread.start()
    os.write(
        writing,
        EVENT.pack(0, 0, KEY, CODES["BTN_TL"], 1) + EVENT.pack(0, 0, ABS, CODES["ABS_X"], END),
    )
    while "jog" not in machine.verbs:
        thread.join(0.01)
    os.close(writing)
    thread.join(10.0)
    assert not thread.is_alive() and machine.verbs[-1] == "jog_stop"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('ABS_Y = "-Y"', 'ABS_Y = "Q"', "ABS_Y"),
        ('dead_man = "BTN_TL"', 'dead_man = "BTN_SOUTH"', "dead_man"),
        ('dead_man = "BTN_TL"', "", "dead_man"),
        ("speed = 0.5", "speed = 2.0", "speed"),
        ('BTN_START = "hold"', 'BTN_START = "start"', "BTN_START"),
        ("[buttons]", "[button]", "button"),
    ],
)
def test_settings_that_are_wrong_are_refused_with_their_key(
    old: str, new: str, words: str, tmp_path: Path
) -> None:
    file = tmp_path / "pendant.toml"
    file.write_text(TEXT.replace(old, new))
    with pytest.raises(ConfigError, match=words):
        pendant.read(file, AXES)
