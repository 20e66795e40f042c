"""A soak on the real clock: one machine as in a shop, run after run on it, judged by its ticks and records.

``serve --simulate`` and ``panel`` run from the beginning to the end, so that what leaks has time to show.
What is asked goes by REST, what befalls a drive by its bus, and in the first runs processes are killed, too.
What must hold beside what is judged on the stepped clock:

* each request has one answer of the documented form, none is an error of ours, and the tick takes numbers
  that rise;
* every tick has its row, and each that sent no SYNC is counted as a skip;
* the axes stand at the end, and the machine is made ready again by what an operator would do;
* every record that came of it is made again bit for bit, and has the setpoints that were seen.

A simulated machine counts late ticks and does not stop for them (``late = "count"``).
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import signal
import threading
import time
import traceback
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from support.live import shop
from support.live.live_machines import processes
from support.live.shop import Shop, Values
from support.soak import judged
from support.soak.memory import Memory
from support.soak.scenarios import Scenario, live_machine
from support.soak.stepped import Came

from controller.cli import recorded_runs
from controller.ipc.control_socket import Client, CommandRefused, control_path
from controller.ipc.handoff import COLUMN, OFF_PATH, PLAN_IDS, of_axes
from controller.ipc.packed_rows import unpacked
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.service.jobs import UNDER_WAY
from controller.state.modes import Fault, Mode
from controller.state.setpoints import SETPOINTS
from drives import bus, pdo

RUN_S = 10.0  # then the operator stops it
END_S = 240.0  # then it hangs, however busy the computer is
POLL_S = 0.5  # between two looks at the rows
RECORD_S = 30.0  # for the record of a run to be written
STANDS_S, STANDS_ROWS = 0.3, 20  # of standstill at the end
STANDS_COUNTS = 50.0
GOING = ("RUNNING", "HOLD", "JOG", "STOPPING", "READY")
ROLES = {"virtual-bus": "hub", "directrix-tick": "tick", "directrix-plan": "plan"}
NMT = {"stop": 2, "preop": 128, "reset_communication": 130}
INJECT_AT = 0x2001  # of a simulated drive: the error that it finds in itself
ACTIONS = ("hold", "override", "rapid", "single", "optional", "resume", "stop", "estop", "wait")
OFTEN = (25, 20, 10, 5, 3, 3, 2, 1, 31)


class Wrong(Exception):
    """Something does not hold."""


class Rows(threading.Thread):
    """Takes every row of the recorder, as the page's scope does; ``taken``: those since the last call."""

    def __init__(self, runtime: Path) -> None:
        super().__init__(daemon=True)
        self._runtime, self._lock, self._over = runtime, threading.Lock(), threading.Event()
        self._parts: list[list[np.ndarray]] = [[]]  # of one tick process each
        self._after: int | None = None

    def run(self) -> None:
        while not self._over.wait(POLL_S):
            with contextlib.suppress(CommandRefused, OSError, ValueError):
                self._look()

    def _look(self) -> None:
        with self._lock, contextlib.closing(Client(control_path(self._runtime))) as door:
            while True:
                told = door.ask("rows", after=self._after)
                came = unpacked(told)
                if told["anew"]:
                    self._parts.append([])
                if not len(came):
                    return
                self._parts[-1].append(came)
                self._after = int(came[-1, COLUMN["tick"]])

    def taken(self) -> list[np.ndarray]:
        """Of each tick process that there was."""
        with contextlib.suppress(CommandRefused, OSError, ValueError):
            self._look()
        with self._lock:
            parts, self._parts = self._parts, [[]]
        return [np.concatenate(part) for part in parts if part]

    def end(self) -> None:
        self._over.set()
        self.join()


def _is_unsure(now: Values) -> bool:
    """Whether somebody must say where the tools of the changer are."""
    return bool(now["changer"] and now["changer"]["doubt"])


class Watched:
    """The shop, with a client that counts and judges every answer."""

    def __init__(self, running: Shop, machine: Machine) -> None:
        self.shop, self.machine, self.told = running, machine, list[str]()
        self.rng, self.begun_s = random.Random(), time.monotonic()
        self.asked = 0
        self.rows = Rows(running.runtime)
        self.known: set[Path] = set()  # records that were looked at
        self.memory = Memory()
        self.logged = 0

    # -- asking

    def say(self, words: str) -> None:
        self.told.append(f"{time.monotonic() - self.begun_s:8.3f} s: {words}")

    def ask(self, method: str, path: str, **json_: Any) -> bool:
        """Whether it was done. Raises Wrong for an answer that is none."""
        self.asked += 1
        answer = self.shop.http.request(method, path, json=json_)
        self.say(f"{method} {path} {json_ or ''} -> {answer.status_code}")
        if answer.is_success:
            return True
        facts = answer.json().get("error", {}) if answer.text.startswith("{") else {}
        if answer.status_code not in (404, 409, 422, 503) or not facts.get("sentence"):
            raise Wrong(f"{method} {path}: {answer.status_code} {answer.text[:300]}")
        self.told[-1] += f" {facts['sentence']}"
        return False

    def status(self) -> Values:
        """Of a panel and a service that are there, or come back."""
        return self.shop.until(lambda now: "mode" in now and now["tick"] is not None, "a status")

    def until(self, holds: Any, what: str) -> Values:
        return self.shop.until(holds, what)

    # -- a run

    def prepare(self) -> None:
        """READY, whatever was before: reset, homed, enabled, as an operator does it."""
        give_up_s = time.monotonic() + END_S
        while (now := self.status())["mode"] != "READY" or now["not_homed"] or _is_unsure(now):
            if time.monotonic() > give_up_s:
                raise Wrong(f"is not made ready again: {now['mode']} {now['fault']} {now['sequence']}")
            busy = (now["sequence"] or {}).get("state") == "running"
            waits = busy or not now["at_rest"] or now["mode"] in ("STOPPING", "HOMING")
            if waits and not self._is_gone(now):
                pass
            elif now["mode"] == "FAULT":
                self.ask("POST", "/machine/reset")
            elif now["mode"] in ("HOLD", "RUNNING"):
                self.ask("POST", "/cycle/stop")
            elif now["mode"] == "READY":
                self.ask("POST", "/machine/disable")
            elif _is_unsure(now):
                self.ask("POST", "/changer/confirm", spindle=now["tool"] or 1, clear=True)
            elif now["not_homed"]:
                self.ask("POST", "/machine/home")
            else:
                self.ask("POST", "/machine/enable")
            time.sleep(0.2)

    def between(self) -> None:
        """What is done between two programs."""
        axis = self.rng.choice(self.machine.axes)
        chance = self.rng.random()
        if chance < 0.15:
            words = {
                a.name: self.rng.uniform(-5.0, 5.0) for a in self.machine.axes if self.rng.random() < 0.5
            }
            line = "G91 G0 " + " ".join(f"{name}{by:.3f}" for name, by in (words or {axis.name: 1.0}).items())
            self.ask("POST", "/mdi", text=f"G21\n{line}\nG90")
        elif chance < 0.3:
            press = f"press {self.rng.random()}"
            for _ in range(self.rng.randrange(1, 8)):
                speed = self.rng.uniform(-1.0, 1.0)
                self.ask("POST", "/jog", frame="joint", axis=axis.name, speed=speed, press=press)
                time.sleep(0.05)
            self.ask("POST", "/jog/stop", press=press)
        elif chance < 0.4:
            by = self.rng.uniform(-4.0, 4.0)
            self.ask("POST", "/jog/step", frame="joint", axis=axis.name, distance=by)
        elif chance < 0.45:
            self.ask("POST", "/machine/disable")
        elif chance < 0.5:
            self.ask("POST", "/machine/home", axes=[axis.name])
        elif chance < 0.55:
            self.ask("POST", "/cycle/start")  # nothing, or the last program once more
            time.sleep(self.rng.uniform(0.0, 1.0))
            self.ask("POST", "/cycle/stop")
        self.until(self._stands, "rest")

    @staticmethod
    def _is_gone(now: Values) -> bool:
        """The tick, and with it who knows whether the axes stand; a reset starts another."""
        return bool(now["mode"] == "FAULT" and now["at_rest"] is None)

    @staticmethod
    def _stands(now: Values) -> bool:
        over = not now["job"] or now["job"]["state"] not in ("loading", *UNDER_WAY)
        busy = (now["sequence"] or {}).get("state") == "running"
        return over and not busy and now["at_rest"] and now["mode"] in ("READY", "OFF", "FAULT", "HOLD")

    def load(self, of: Scenario) -> bool:
        name = f"part-{of.number}.ngc"
        self.shop.do("POST", "/programs", files={"file": (name, of.program.encode())})
        return self.ask("POST", "/job", program=name) and self._is_loaded()

    def _is_loaded(self) -> bool:
        now = self.until(lambda now: (now["job"] or {}).get("state") != "loading", "the program")
        return bool(now["job"]) and now["job"]["state"] == "loaded"

    def forget(self, of: Scenario) -> None:
        self.ask("DELETE", "/job")
        self.ask("DELETE", f"/programs/part-{of.number}.ngc")

    def operate(self, of: Scenario) -> None:
        """From the start to the end, one way or another."""
        begun_s = time.monotonic()
        struck = not of.script
        due_s = float(of.script.split()[0]) if of.script else 0.0
        while True:
            now, passed_s = self.status(), time.monotonic() - begun_s
            if self._stands(now) and now["mode"] != "HOLD":
                self.say(f"ended in {now['mode']}: {(now['job'] or {}).get('state')}")
                return
            if passed_s > END_S:
                raise Wrong(f"the run does not end; it is in {now['mode']}")
            if not struck and passed_s >= due_s:
                struck = True
                self.strike(of.script.partition(": ")[2])
            elif self._is_gone(now):
                self.ask("POST", "/machine/reset")
            elif now["mode"] not in GOING:
                pass  # it has a fault, or comes up again
            elif passed_s > RUN_S:
                self.ask("POST", "/cycle/stop")
            elif now["mode"] == "HOLD" and now["at_rest"]:
                self._held(now)
            else:
                self._running(now)
            time.sleep(self.rng.uniform(0.02, 0.5))

    def _running(self, now: Values) -> None:
        act = self.rng.choices(ACTIONS, OFTEN)[0]
        if act in ("hold", "resume", "stop"):
            self.ask("POST", f"/cycle/{act}")
        elif act == "estop":
            self.ask("POST", "/machine/estop")
        elif act == "override" or now["override"] == 0.0:
            self.ask("PUT", "/overrides/feed", share=self.rng.choice((0.02, 0.3, 1.0, 1.0, 1.5, 2.0)))
        elif act == "rapid" or now["rapid_override"] == 0.0:
            self.ask("PUT", "/overrides/rapid", share=self.rng.choice((0.25, 0.5, 1.0)))
        elif act in ("single", "optional"):
            name = "single_block" if act == "single" else "optional_stop"
            self.ask("PUT", f"/cycle/{name}", on=self.rng.random() < 0.4)

    def _held(self, now: Values) -> None:
        chance, away = self.rng.random(), now["aside"]
        if now["tool_change"]:
            self.ask("POST", "/cycle/resume")
        elif chance < 0.12 and not away:
            self.ask("POST", "/cycle/retract", mm=self.rng.choice((1.0, 5.0, 12.0)))
        elif chance < 0.2:
            axis, by = self.rng.choice(self.machine.axes).name, self.rng.uniform(-3.0, 3.0)
            self.ask("POST", "/jog/step", frame="joint", axis=axis, distance=by)
        elif away:
            self.ask("POST", "/cycle/return")
        elif chance < 0.24:
            self.ask("POST", "/cycle/stop")
        elif not self.ask("POST", "/cycle/resume"):
            self.ask("POST", "/cycle/return")  # jogged away

    # -- what befalls it

    def strike(self, words: str) -> None:
        self.say(words)
        what, name, *more = words.split()
        if what == "kill":
            self._kill(name)
            return
        if what == "stop":
            self._stop(name, 1e-3 * float(more[1]))
            return
        axis = next(one for one in self.machine.axes if one.name == name)
        facts = {one["name"]: one["channel"] for one in self.shop.do("GET", "/facts")["buses"]}
        (settings,) = (s for s in machine_file.bus_settings(self.machine) if s.name == axis.bus)
        port = bus.open(replace(settings, interface="virtual", channel=facts[axis.bus]), filters=[])
        if what == "nmt":
            port.send(pdo.frame(pdo.NMT, bytes((NMT[more[0]], axis.node))))
        else:  # an SDO download of two bytes (CiA 301, 7.2.4.3.3)
            code = int(more[0], 16)
            place = bytes((0x2B, INJECT_AT & 0xFF, INJECT_AT >> 8, 0))
            port.send(pdo.frame(0x600 + axis.node, place + code.to_bytes(4, "little")))
        time.sleep(0.01)
        port.close()

    def _kill(self, name: str) -> None:
        if name in self.shop.processes:
            self.shop.kill(name)
            self.status()
            self.shop.take_control()
        elif (pid := self.pids().get(name)) is not None:
            os.kill(pid, signal.SIGKILL)

    def _stop(self, name: str, seconds: float) -> None:
        """For so long it is not there, as on a computer that has other work."""
        if (pid := self.pids().get(name)) is not None:
            os.kill(pid, signal.SIGSTOP)
            time.sleep(seconds)
            os.kill(pid, signal.SIGCONT)

    def pids(self) -> dict[str, int]:
        """Of every process, by what it does; hubs are numbered."""
        serve, panel = (self.shop.processes[name].pid for name in ("serve", "panel"))
        found = {"service": serve, "panel": panel}
        for pid, name in sorted(processes(serve).items()):
            role = ROLES.get(name, name)
            found[f"{role}{sum(one.startswith(role) for one in found) or ''}"] = pid
        return found

    # -- what came of it

    def records(self) -> list[Path]:
        """Those of runs that have ended since the last call, once they are written."""
        folder, give_up_s = self.shop.state / "runs", time.monotonic() + RECORD_S
        while list(folder.glob("*/begun.json")):
            if time.monotonic() > give_up_s:
                raise Wrong("a run has ended, and its record is not written")
            time.sleep(0.1)
        there = {one.parent for one in folder.glob("*/run.json")}
        new, self.known = sorted(there - self.known), there
        return new

    def complaints(self) -> str:
        """What a process has said of an error of its own since the last call."""
        logs = self.shop.logs()
        new, self.logged = logs[self.logged :], len(logs)
        return new[new.index("Traceback") :][:2000] if "Traceback" in new else ""


@contextlib.contextmanager
def opened(seed: int, folder: Path) -> Iterator[Watched]:
    """The machine of that soak, ready; it ends with the block."""
    made = live_machine(seed)
    text = re.sub(r"(?m)^period_s *=.*$", f"period_s = {made.period_s}", made.text)
    text = re.sub(r"(?m)^file *=.*\n", "", text)  # of tools, which stand in it by now
    with shop.opened(folder, machine=text) as running:
        running.up()
        found = Watched(running, machine_file.read(text, "machine.toml"))
        found.rows.start()
        try:
            found.prepare()
            found.rows.taken()
            yield found
        finally:
            found.rows.end()


def run(on: Watched, of: Scenario) -> Came:
    """Run, judge, and make again what was recorded. Raises nothing: what is raised is wrong."""
    on.told, on.rng, on.begun_s = [], random.Random(f"operator {of.operator}"), time.monotonic()
    result, wrong, record, ticks = "refused", list[judged.Wrong](), None, 0
    try:
        on.prepare()
        before = on.status()["tick"]
        on.between()
        on.prepare()
        if on.load(of) and on.ask("POST", "/cycle/start"):
            on.operate(of)
            result = str((on.status()["job"] or {}).get("state"))
        stood = on.until(on._stands, "rest")["tick"]
        time.sleep(STANDS_S)
        parts = on.rows.taken()
        ticks = sum(map(len, parts))
        records = on.records()
        record = records[-1] if records else None
        wrong = _found(on, of, parts, before, stood)
        for one in records:
            wrong += _of_record(one, parts)
        on.forget(of)
        if complaint := on.complaints():
            wrong.append((0, complaint))
    except (Wrong, Exception) as error:
        result = "raised"
        wrong.append((0, str(error) if isinstance(error, Wrong) else traceback.format_exc()))
    on.memory.look(on.pids(), time.monotonic())
    text, tick = "; ".join(what for _, what in wrong), int(wrong[0][0]) if wrong else 0
    return Came(result, text, tick, ticks, tuple(on.told), record)


def _found(
    on: Watched, of: Scenario, parts: list[np.ndarray], before: Values, stood: Values
) -> list[judged.Wrong]:
    found, T = list[judged.Wrong](), COLUMN["tick"]
    asked = [one for one in on.told if "estop" in one]
    for rows in parts:
        numbers = rows[:, COLUMN["request"]]
        numbers = numbers[(numbers != 0.0) & (numbers < PLAN_IDS)]
        if (np.diff(numbers) <= 0.0).any():
            found.append((int(rows[0, T]), "the tick has taken a request twice, or out of its order"))
        for sound in _sound(rows):
            found += judged.limits(on.machine, sound) + judged.counts(on.machine, sound)
        faults = rows[:, COLUMN["fault"]]
        faults = 1 + np.flatnonzero((faults[1:] != 0.0) & (faults[:-1] == 0.0))
        if len(faults) and not of.script and not asked:
            name = Fault(int(rows[faults[0], COLUMN["fault"]])).name
            found.append((int(rows[faults[0], T]), f"a fault out of nothing: {name}"))
    if len(parts) == 1 and "kill serve" not in of.script and "kill tick" not in of.script:
        found += _skips(parts[0], before, stood)
    if parts:
        actual = parts[-1][-STANDS_ROWS:, of_axes("setpoint", len(on.machine.axes))]
        if np.ptp(actual, axis=0).max() > STANDS_COUNTS:
            found.append((int(parts[-1][-1, T]), "the axes do not stand at the end"))
    return found


def _sound(rows: np.ndarray) -> list[np.ndarray]:
    """Segments of rows in which the tick leads the axes, and no fault has taken the path away."""
    leads = rows[:, COLUMN["switches"]].astype(int) & OFF_PATH == 0
    good = leads & (rows[:, COLUMN["fault"]] == 0.0) & (rows[:, COLUMN["mode"]] != Mode.FAULT)
    edges = np.flatnonzero(np.diff(good.astype(int), prepend=0, append=0))
    return [rows[a:b] for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _skips(rows: np.ndarray, before: Values, stood: Values) -> list[judged.Wrong]:
    """Ticks that have no row, or a row without SYNC, are those that are counted, and no more."""
    ticks = rows[:, COLUMN["tick"]]
    here = rows[(ticks > before["number"]) & (ticks <= stood["number"])]
    unsent = int(np.count_nonzero(here[:, COLUMN["sync_sent"]] == 0.0))
    missed = stood["number"] - before["number"] - len(here)
    counted = stood["skips"] - before["skips"]
    if counted == unsent + missed:
        return []
    return [(before["number"], f"{counted} skips are counted, {missed} ticks missed and {unsent} unsent")]


def _of_record(folder: Path, parts: list[np.ndarray]) -> list[judged.Wrong]:
    """It has what was seen, runs on its program's motions, and comes again."""
    facts = json.loads((folder / "run.json").read_text())
    sent = SETPOINTS.read(folder)
    if facts.get("first_tick", -1) < 0 or sent is None or not len(sent):
        return []
    whole = recorded_runs.whole(folder, None, None)
    axes, found = len(whole.machine.axes), list[judged.Wrong]()
    for rows in parts:
        mine = rows[rows[:, COLUMN["tick"]] >= facts["first_tick"]]
        mine = mine[mine[:, COLUMN["sync_sent"]] != 0.0][: len(sent)]
        seen = mine[:, of_axes("setpoint", axes)].astype(np.int64)
        if facts["result"] != "lost" and len(parts) == 1 and not np.array_equal(seen, sent[:, :axes]):
            found.append((facts["first_tick"], f"{folder.name} has other setpoints than were seen"))
        begin = whole.recorded.begin.start
        if begin.spot is None and not begin.typed and not begin.dry_run_mm and len(parts) == 1:
            segment = [one for one in _sound(mine) if len(one)][:1]
            text = whole.text.decode()
            for one in segment:
                found += judged.path(text, whole.machine, one, begin.joints, begin.in_spindle)
    found += judged.again(folder)
    return [(tick, f"{folder.name}: {text}") for tick, text in found]
