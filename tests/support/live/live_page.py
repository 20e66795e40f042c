"""The page before a machine that moves, for tests that count in ticks.

How long something took is read from the machine's own rows, whose ticks lie on a grid of time. Which
tick it was when a key went down is reckoned from the latest that the grid can have begun, and taken
before the key is pressed: both can only make a time longer than it was.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from support.live import browser, shop
from support.live.browser import until

from controller.ipc.control_socket import Client, CommandRefused, control_path
from controller.ipc.handoff import COLUMN
from controller.ipc.packed_rows import unpacked
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.state.modes import MAX_AXES, Mode

LOOKS = 40  # at the tick's number: enough that one of them comes just behind a tick
QUIET_TICKS = 60  # in which nothing may come late
BEFORE_TICKS = 5  # whose speed is that of the jog
COMMAND = COLUMN["joint_command_0"]

Rows = np.ndarray


class LiveMachine:
    """A shop that is ready, its panel before a browser, and its rows."""

    def __init__(self, running: shop.Shop) -> None:
        self.shop = running
        self.machine: Machine = machine_file.load(str(running.machine_file))
        self.period_s = self.machine.period_s
        self.door = Client(control_path(running.runtime))
        self._began_s = float("inf")  # the latest that tick 0 can have been due
        for _ in range(LOOKS):
            self._look()
            time.sleep(0.37 * self.period_s)

    def _look(self) -> None:
        """A tick that was told of had been due before the answer came."""
        number = int(self.door.ask("status")["tick"]["number"])
        self._began_s = min(self._began_s, time.monotonic() - number * self.period_s)

    def tick(self) -> float:
        """The tick that it is now, with its share, or an earlier one."""
        return (time.monotonic() - self._began_s) / self.period_s

    def rows(self, after: float) -> Rows:
        """Rows of the ticks after that one, (N, columns of a row)."""
        found: list[Rows] = []
        last = int(after)
        while not found or len(found[-1]):
            found.append(unpacked(self.door.ask("rows", after=last)))
            last = int(found[-1][-1, COLUMN["tick"]]) if len(found[-1]) else last
        return np.concatenate(found)

    def until_ready(self) -> None:
        """Ready for the next measurement."""

        def rests() -> bool:
            with contextlib.suppress(CommandRefused):
                now = self.door.ask("status")
                assert not now["fault"], now["fault"]
                return bool(now["mode"] == "READY")
            return False

        until(rests, "READY")

    def left_running_s(self, since: float) -> float:
        """From a tick until the first that runs no more."""

        def found() -> float | None:
            rows = self.rows(since)
            ended = np.flatnonzero(rows[:, COLUMN["mode"]] != Mode.RUNNING)
            assert not len(ended) or rows[ended[0], COLUMN["mode"]] != Mode.FAULT
            return float(rows[ended[0], COLUMN["tick"]]) if len(ended) else None

        return (until(found, "the stop") - since) * self.period_s

    def came_to_rest_s(self, since: float) -> tuple[float, float]:
        """(from a tick until the commands stand for good, how long the limits make that last) in seconds."""

        def stands() -> bool:
            tail = self.rows(since)[-QUIET_TICKS:]
            assert not len(tail) or tail[-1, COLUMN["mode"]] != Mode.FAULT
            still = len(tail) == QUIET_TICKS and not np.ptp(_commands(tail), axis=0).any()
            return still and tail[-1, COLUMN["mode"]] != Mode.JOG

        until(stands, "standstill")
        rows = self.rows(since - BEFORE_TICKS)
        steps = np.diff(_commands(rows), axis=0)
        moved = np.flatnonzero(steps.any(axis=1))
        last = float(rows[moved[-1] + 1, COLUMN["tick"]]) if len(moved) else since
        speeds = np.abs(steps).max(axis=0) / self.period_s
        return (last - since) * self.period_s, self._stop_s(speeds)

    def stood(self, since: float) -> bool:
        """Whether nothing has moved since that tick."""
        rows = self.rows(since)
        return len(rows) > 0 and not np.ptp(_commands(rows), axis=0).any()

    def _stop_s(self, speeds: Rows) -> float:
        """The longest stop of an axis from such a speed, by its limits."""
        limits = [axis.limits for axis in self.machine.axes]
        moving = [(v, axis) for v, axis in zip(speeds, limits, strict=True) if v > 0.0]
        return max((v / axis.acceleration + axis.acceleration / axis.jerk for v, axis in moving), default=0.0)


def _commands(rows: Rows) -> Rows:
    return rows[:, COMMAND : COMMAND + MAX_AXES]


@contextlib.contextmanager
def ready(folder: Path) -> Iterator[LiveMachine]:
    """A machine that is homed and on, of which nobody has control."""
    with shop.opened(folder) as running:
        running.ready()
        running.do("DELETE", "/control")
        yield LiveMachine(running)


@contextlib.contextmanager
def page(context: Any, running: shop.Shop, view: str = "run", control: bool = True) -> Iterator[Any]:
    """A page in a browser's context; its scripts must not have failed."""
    made = browser.opened(context, running, view)
    if control:  # from whoever left without giving it
        made.evaluate(
            "dx.call('POST', 'control', {take_over: true}).then((s) => { dx.token = s.body.token; })"
        )
        made.wait_for_selector("body[data-control=mine]")
    yield made
    if not made.is_closed():
        made.close()
    assert not made.errors, made.errors


def wait(one: Any, condition: str) -> None:
    """Until the page's status is as wanted; a fault meanwhile fails."""
    one.wait_for_function(f"() => window.dx?.status && (dx.status.fault || ({condition}))")
    fault = one.evaluate("dx.status.fault?.name")
    assert fault is None, fault


def seen_as_it_is(one: Any) -> None:
    """From now on the page notices when another one comes to the front."""
    session = one.context.new_cdp_session(one)
    session.send("Emulation.setFocusEmulationEnabled", {"enabled": False})
    one.bring_to_front()
    one.wait_for_function("() => document.hasFocus()")


def drop(one: Any, *files: Path, on: str = "#programs-drop") -> None:
    """Files of this computer, dragged onto the page as by a hand."""
    box = one.locator(on).bounding_box()
    session = one.context.new_cdp_session(one)
    data = {"items": [], "files": [str(file) for file in files], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        place = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
        session.send("Input.dispatchDragEvent", {"type": kind, "data": data, **place})
    session.detach()


def shortest_s(
    machine: LiveMachine, measure: Callable[[], tuple[float, float]], tries: int = 3
) -> tuple[float, float]:
    """(seconds, allowed) of the first measurement within what is allowed, else of the best.

    Only the machine's own way is judged: what else runs on this computer may hold the browser back.
    """
    found: list[tuple[float, float]] = []
    while len(found) < tries and not any(took <= allowed for took, allowed in found):
        machine.until_ready()
        found.append(measure())
    print("".join(f"\n{took * 1e3:.0f} ms of {allowed * 1e3:.0f}" for took, allowed in found))
    return min(found, key=lambda one: one[0] - one[1])
