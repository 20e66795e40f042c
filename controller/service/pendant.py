"""A handwheel or a gamepad at the machine: Linux input events as jog requests, with a dead man's switch.

    device = "/dev/input/by-id/usb-Some_Maker_Pad-event-joystick"
    dead_man = "BTN_TL"            # nothing moves while it is up; as it goes up, all of it stops
    speed = 0.5                    # share of the jog speed at a stick's end
    [sticks]
    ABS_X = "X"
    ABS_Y = "-Y"
    [wheel]
    event = "REL_DIAL"
    step = 0.01                    # mm, degrees of a rotary, for each detent
    [wheel.axes]                   # a button takes the wheel to an axis
    BTN_SOUTH = "X"
    [buttons]                      # at once, whether the dead man's switch is down or not
    BTN_START = "hold"

It asks at the control socket as any client does, so that it has no way to the machine that others have not.
A device that is gone, events that were lost (SYN_DROPPED) and a refusal count as a switch that went up; the
tick stops by itself 200 ms after the last request. Events: linux/input.h, ``struct input_event``.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import select
import struct
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from controller.ipc.control_socket import Client, CommandRefused
from controller.machine.toml_table import Table, parse, read_text

EVENT = struct.Struct("llHHi")  # seconds, microseconds, type, code, value
SYN, KEY, REL, ABS = 0, 1, 2, 3
DROPPED = 3  # of SYN
CODES = {
    **{f"BTN_{n}": 0x100 + n for n in range(10)},
    **{"BTN_TRIGGER": 0x120, "BTN_THUMB": 0x121, "BTN_SOUTH": 0x130, "BTN_EAST": 0x131, "BTN_NORTH": 0x133},
    **{"BTN_WEST": 0x134, "BTN_TL": 0x136, "BTN_TR": 0x137, "BTN_TL2": 0x138, "BTN_TR2": 0x139},
    **{"BTN_SELECT": 0x13A, "BTN_START": 0x13B, "BTN_MODE": 0x13C, "BTN_THUMBL": 0x13D, "BTN_THUMBR": 0x13E},
    **{"ABS_X": 0, "ABS_Y": 1, "ABS_Z": 2, "ABS_RX": 3, "ABS_RY": 4, "ABS_RZ": 5, "ABS_HAT0X": 16},
    **{"ABS_HAT0Y": 17, "REL_X": 0, "REL_Y": 1, "REL_HWHEEL": 6, "REL_DIAL": 7, "REL_WHEEL": 8},
}
STOPS = ("hold", "stop", "estop")
DEAD_ZONE = 0.15  # of a stick's way: none comes back to its very middle
AGAIN_S = 0.07  # between two requests of a jog
OPEN_S = 1.0  # between two attempts to find the device
ANSWER_TIMEOUT_S = 0.5
FULL = (-32768, 32767)  # of a stick that does not say how far it goes
_ABSINFO = struct.Struct("6i")
_ASK_ABS = 0x80184540  # EVIOCGABS(0)


class Wheel(NamedTuple):
    """``axes``: by the code of their button."""

    code: int
    step: float
    axes: Mapping[int, str]


class Settings(NamedTuple):
    """Of one device; codes instead of names. A stick's axis has its sign."""

    device: Path
    dead_man: int
    speed: float
    sticks: Mapping[int, tuple[str, int]]
    wheel: Wheel | None
    buttons: Mapping[int, str]


class Asks(Protocol):
    """What is needed of ``control_socket.Client``."""

    def ask(self, verb: str, **args: Any) -> dict[str, Any]: ...


def read(file: Path, axes: tuple[str, ...]) -> Settings:
    """The settings of a file, for a machine with these axes. Raises ConfigError."""
    top = parse(read_text(file), str(file))
    names = [*axes, *(f"-{axis}" for axis in axes)]
    sticks = _codes(top.table("sticks", "[sticks]"), "ABS_", names) if top.has("sticks") else {}
    wheel = _wheel(top.table("wheel", "[wheel]"), list(axes)) if top.has("wheel") else None
    buttons = _codes(top.table("buttons", "[buttons]"), "BTN_", list(STOPS)) if top.has("buttons") else {}
    found = Settings(
        Path(top.text("device")),
        CODES[top.text("dead_man", _named("BTN_"))],
        top.number("speed", 0.01, 1.0, default=0.5),
        {code: (axis.removeprefix("-"), -1 if axis[0] == "-" else 1) for code, axis in sticks.items()},
        wheel,
        buttons,
    )
    top.finish()
    used = [*found.buttons, *(wheel.axes if wheel else ())]
    if found.dead_man in used:
        top.refuse("dead_man", "dead_man_taken")
    return found


def _named(kind: str) -> list[str]:
    return [name for name in CODES if name.startswith(kind)]


def _codes(table: Table, kind: str, values: list[str]) -> dict[int, str]:
    found = {CODES[name]: table.text(name, values) for name in _named(kind) if table.has(name)}
    table.finish()
    return found


def _wheel(table: Table, axes: list[str]) -> Wheel:
    code = CODES[table.text("event", _named("REL_"))]
    step = table.number("step", 1e-4, 10.0, default=0.01)
    found = Wheel(code, step, _codes(table.table("axes", "[wheel.axes]"), "BTN_", axes))
    table.finish()
    return found


class Hand:
    """What the hand at the device wants, as its events tell it."""

    def __init__(self, settings: Settings, full: Mapping[int, tuple[int, int]]) -> None:
        """``full``: lowest and highest value of each stick."""
        self._settings, self._full = settings, full
        self.holds = False  # the dead man's switch
        self._deflected: dict[int, float] = {}
        self._axis = next(iter(settings.wheel.axes.values()), "") if settings.wheel else ""
        self._detents = 0

    def feel(self, kind: int, code: int, value: int) -> str:
        """One event; a stop that is asked for by it, or nothing."""
        settings, wheel = self._settings, self._settings.wheel
        if kind == SYN and code == DROPPED:
            self.let_go()
        elif kind == KEY and code == settings.dead_man:
            if value == 0:
                self.let_go()
            elif value == 1:  # 2: it repeats itself, which nobody has pressed
                self.holds = True
        elif kind == KEY and value == 1:
            if wheel is not None and code in wheel.axes:
                self._axis, self._detents = wheel.axes[code], 0
            return settings.buttons.get(code, "")
        elif kind == ABS and code in settings.sticks:
            self._deflected[code] = self._share(code, value)
        elif kind == REL and wheel is not None and code == wheel.code and self.holds:
            self._detents += value
        return ""

    def _share(self, code: int, value: int) -> float:
        low, high = self._full.get(code, FULL)
        share = max(-1.0, min(1.0, (2.0 * value - low - high) / (high - low or 1)))
        beyond = (abs(share) - DEAD_ZONE) / (1.0 - DEAD_ZONE)
        return 0.0 if beyond <= 0.0 else beyond if share > 0.0 else -beyond

    def let_go(self) -> None:
        """As if the switch had gone up: it has to be pressed anew."""
        self.holds, self._detents = False, 0

    def jog(self) -> tuple[str, float]:
        """Axis and share of the jog speed of the stick that is deflected most; ("", 0) where nothing is."""
        if not self.holds or not self._deflected:
            return "", 0.0
        code = max(self._deflected, key=lambda one: abs(self._deflected[one]))
        share = self._deflected[code]
        axis, sign = self._settings.sticks[code]
        return (axis, sign * share * self._settings.speed) if share else ("", 0.0)

    def step(self) -> tuple[str, float]:
        """Axis and distance of what the wheel was turned since it was asked last."""
        wheel, detents = self._settings.wheel, self._detents
        self._detents = 0
        return (self._axis, detents * wheel.step) if wheel and detents and self.holds else ("", 0.0)


class Pendant:
    """Asks for what the hand wants; ``turn`` is called again and again."""

    def __init__(self, hand: Hand, client: Asks) -> None:
        self._hand, self._client = hand, client
        self._press = ""  # of the jog under way
        self._presses = 0
        self._stepping = False

    def feel(self, kind: int, code: int, value: int) -> None:
        """One event; stops go out at once."""
        held = self._hand.holds
        if stop := self._hand.feel(kind, code, value):
            self._ask(stop)
        if held and not self._hand.holds:
            self.end()

    def turn(self) -> None:
        """What is due now."""
        axis, speed = self._hand.jog()
        if axis:
            self._presses += not self._press
            self._press = self._press or f"pendant-{os.getpid()}-{time.monotonic_ns()}-{self._presses}"
            self._ask("jog", frame="joint", axis=axis, speed=speed, press=self._press)
        elif self._press:
            self.end()
        else:
            self._step()

    def _step(self) -> None:
        """A step under way comes to its end before the next one, or detents would be lost."""
        if self._stepping and self._ask("status").get("mode") == "JOG":
            return
        axis, distance = self._hand.step()
        self._stepping = bool(axis)
        if axis:
            self._ask("jog_step", frame="joint", axis=axis, distance=distance)

    def end(self) -> None:
        """Whatever moves by it stops."""
        press, self._press = self._press, ""
        if press or self._stepping:
            self._stepping = False
            self._ask("jog_stop", **({"press": press} if press else {}))

    def _ask(self, verb: str, **args: Any) -> dict[str, Any]:
        """Where it is refused the hand must let go first: it would begin by itself once it is allowed."""
        try:
            return self._client.ask(verb, **args)
        except CommandRefused:
            if verb in ("jog", "jog_step"):
                self._hand.let_go()
                self.end()
            return {}


def _full(device: int, code: int) -> tuple[int, int]:
    """Lowest and highest value of a stick."""
    buffer = bytearray(_ABSINFO.size)
    try:
        fcntl.ioctl(device, _ASK_ABS + code, buffer)
    except OSError:
        return FULL
    _, low, high, *_ = _ABSINFO.unpack(buffer)
    return (low, high) if high > low else FULL


def follow(device: int, settings: Settings, client: Asks, over: Callable[[], bool]) -> None:
    """Until it is ``over``, or the device is gone."""
    pendant = Pendant(Hand(settings, {code: _full(device, code) for code in settings.sticks}), client)
    poll = select.poll()
    poll.register(device, select.POLLIN)
    due_s = 0.0
    try:
        while not over():
            if poll.poll(max(0.0, due_s - time.monotonic()) * 1e3):
                for _, _, kind, code, value in EVENT.iter_unpack(_events(device)):
                    pendant.feel(kind, code, value)
            if time.monotonic() >= due_s:
                pendant.turn()
                due_s = time.monotonic() + AGAIN_S
    except OSError:
        pass  # it was pulled out
    finally:
        pendant.end()


def _events(device: int) -> bytes:
    """Whole ones. Raises OSError where nobody sends any more."""
    found = os.read(device, 64 * EVENT.size)
    if not found:
        raise OSError("the device is gone")
    return found[: len(found) // EVENT.size * EVENT.size]


@contextlib.contextmanager
def following(settings: Settings | None, control: Path) -> Iterator[None]:
    """In a thread, as long as the block lasts; a device that is not there yet is waited for."""
    if settings is None:
        yield
        return
    ended = threading.Event()

    def wait_and_follow() -> None:
        client = Client(control, ANSWER_TIMEOUT_S)
        while not ended.is_set():
            with contextlib.suppress(OSError):
                device = os.open(settings.device, os.O_RDONLY | os.O_CLOEXEC)
                try:
                    follow(device, settings, client, ended.is_set)
                finally:
                    os.close(device)
            ended.wait(OPEN_S)
        client.close()

    thread = threading.Thread(target=wait_and_follow, name="pendant", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join(2.0 * OPEN_S)
