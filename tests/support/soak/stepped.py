"""One scenario on the stepped clock: run as a service runs it, with its record, judged tick by tick.

What must hold, whatever is asked and whatever goes wrong:

* ticks follow each other, and on a machine that nothing befalls each sends its SYNC and no fault comes;
* the commanded joints keep velocity, acceleration and jerk at every tick until a fault takes the path away;
* what is sent is what is commanded, to the count;
* while the program's own motions run, the joints are on them to 1e-6 mm;
* the motors are where they were told to be, or a fault says so, and they stand in time (``invariants``);
* nothing is raised, and the run comes to an end;
* made again from its record, every setpoint is the same.
"""

from __future__ import annotations

import random
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from support.faults.invariants import wrongs
from support.machines.recording_bench import RecordedBench
from support.soak import judged
from support.soak.scenarios import Scenario

from controller.ipc.handoff import COLUMN, Jog
from controller.runtime.bench.fault_file import MachineScript
from controller.runtime.plan_messages import Answer, Order, Program
from controller.runtime.startup import SessionError
from controller.service.runs import RunRecord
from controller.state.modes import Fault, Mode, Request

RUN_S = 10.0  # of the machine: then the operator stops it
END_S = 40.0  # then it hangs
STILL_S = 0.5  # after a fault, looked at
UP = Jog((0.0, 0.0, 1.0, 0.0, 0.0), 20.0, 3.0)
IN_SPINDLE = 2
GOING = (Mode.RUNNING, Mode.HOLD, Mode.JOG, Mode.STOPPING)


@dataclass(frozen=True)
class Came:
    """What came of a scenario: ``wrong`` is empty where all held."""

    result: str  # 'completed', 'stopped', 'fault', 'refused'
    wrong: str
    tick: int
    ticks: int
    told: tuple[str, ...] = ()
    record: Path | None = None


class Ended(Exception):
    """Nothing runs any more."""


class Operator(RecordedBench):
    """Somebody at a machine, who asks for what the page has, by chance."""

    def __init__(self, folder: Path, of: Scenario) -> None:
        super().__init__(folder, of.machine)
        self.rng, self.told = random.Random(f"operator {of.operator}"), list[str]()
        self.of, self.most = of, 0
        self.observer = self.stepped.observe()

    @property
    def mode(self) -> Mode:
        return self.stepped.cycle.modes.mode

    def begin(self) -> str:
        """Armed and started; what it is refused with, or ""."""
        self._rows.drain()
        self.asked.clear()
        self.record, self._is_on = RunRecord(self._state, self.machine, {"name": "part.ngc"}), True
        program = Program(self.of.program.encode(), "part.ngc", self.machine, in_spindle=IN_SPINDLE)
        answer = self.ordered("arm", program=program)
        if answer.error is not None:
            return str(answer.error)
        self.start = answer.facts["start"]
        self.record.begins(self.start, program, self.fitted)
        if self.of.script:
            self.observer.begin(0.0)
            MachineScript.read(self.of.script, self.machine).inject(self.stepped.rig.buses, 0.0)
        self.most = self.stepped.cycle.tick + round(RUN_S / self.machine.period_s)
        self.say(Request.START)
        return ""

    def ordered(self, verb: str, **more: Any) -> Answer:
        """As ``order``; what ends meanwhile gives no answer."""
        number = next(self._numbers)
        self.planning.carry_out(Order(number, verb, **more))
        self._turn()
        there = lambda: any(one.number == number for one in self.answers)  # noqa: E731
        self.rows.append(self.stepped.go(20_000, lambda: there() or self.mode is Mode.FAULT))
        found = [one for one in self.answers if one.number == number]
        return found[-1] if found else Answer(number, error=("lost", verb))

    def say(self, request: Request, value: float = 0.0) -> None:
        self.told.append(f"tick {self.stepped.cycle.tick} in {self.mode.name}: {request.name} {value:g}")
        self.request(request, value)

    def go_on(self, ticks: int) -> None:
        """Raises Ended."""
        cycle = self.stepped.cycle
        idle = lambda: self.mode not in GOING and cycle.follow.at_rest  # noqa: E731
        self.rows.append(self.stepped.go(ticks, idle))
        if idle():
            raise Ended

    def run(self) -> None:
        """Until the program has ended, one way or another."""
        end = self.stepped.cycle.tick + round(END_S / self.machine.period_s)
        try:
            while True:
                self.go_on(self.rng.randrange(1, 600))
                if self.stepped.cycle.tick > end:
                    raise AssertionError(f"the run does not end; it is in {self.mode.name}")
                if self.stepped.cycle.tick > self.most:
                    self.say(Request.STOP)
                elif self.mode is Mode.HOLD and self.stepped.cycle.follow.at_rest:
                    self._held()
                else:
                    self._running()
        except Ended:
            self.told.append(f"tick {self.stepped.cycle.tick}: ended in {self.mode.name}")

    def _running(self) -> None:
        chance, share = self.rng.random(), self.rng.choice((0.0, 0.02, 0.3, 1.0, 1.0, 1.5, 2.0))
        if chance < 0.25:
            self.say(Request.HOLD)
        elif chance < 0.45:
            self.say(Request.OVERRIDE, share)
        elif chance < 0.55:
            self.say(Request.RAPID_OVERRIDE, self.rng.choice((0.0, 0.25, 0.5, 1.0)))
        elif chance < 0.60:
            self.say(Request.SINGLE_BLOCK, float(self.rng.random() < 0.4))
        elif chance < 0.63:
            self.say(Request.RESUME)
        elif chance < 0.65:
            self.say(Request.STOP)
        elif chance < 0.655:
            self.say(Request.ESTOP)
        if self.stepped.cycle.modes.override == 0.0 or self.stepped.cycle.modes.rapid_override == 0.0:
            self.go_on(self.rng.randrange(1, 200))
            self.say(Request.OVERRIDE, 1.0)
            self.say(Request.RAPID_OVERRIDE, 1.0)

    def _held(self) -> None:
        chance, away = self.rng.random(), self.planner.aside is not None
        if chance < 0.12 and not away:
            self._led("retract", distance_mm=self.rng.choice((1.0, 5.0, 12.0)))
        elif chance < 0.2:
            self.told.append(f"tick {self.stepped.cycle.tick}: jog")
            self.jog(UP)
        elif away or self.stepped.cycle.jogging.away:
            self._led("return")
        elif chance < 0.24:
            self.say(Request.STOP)
        else:
            self.say(Request.RESUME)

    def _led(self, verb: str, **more: Any) -> None:
        self.told.append(f"tick {self.stepped.cycle.tick}: {verb} {more}")
        if self.ordered(verb, **more).error is None:
            self.say(Request.RESUME)


def run(of: Scenario, folder: Path) -> Came:
    """Run, judge and make it again. Raises nothing: what is raised is wrong."""
    bench: Operator | None = None
    try:
        bench = Operator(folder, of)
        first = bench.stepped.cycle.tick + 1
        bench.rows.clear()
        if refused := bench.begin():
            return Came("refused", "", 0, 0, (refused,))
        bench.run()
        fault = bench.stepped.cycle.modes.fault
        result = "fault" if bench.mode is Mode.FAULT else _result(bench)
        record = bench.ended(result)
        rows = np.concatenate(bench.rows)
        bench.rows.append(bench.stepped.go(round(STILL_S / of.machine.period_s)))
        found = list(_found(of, bench, rows, first)) + judged.again(record)
        tick = int(found[0][0]) if found else 0
        told = (*bench.told, f"fault: {fault.name}")
        return Came(result, "; ".join(text for _, text in found), tick, len(rows), told, record)
    except (SessionError, Exception) as error:
        told = tuple(bench.told) if bench is not None else ()
        tick = bench.stepped.cycle.tick if bench is not None else 0
        wrong = "".join(traceback.format_exception(error))
        record = getattr(bench, "record", None)
        return Came("raised", wrong, tick, 0, told, record.folder if record is not None else None)


def _result(bench: Operator) -> str:
    stopped = any("STOP" in one for one in bench.told[-3:])
    return "stopped" if stopped else "completed"


def _found(of: Scenario, bench: Operator, rows: np.ndarray, first: int) -> list[judged.Wrong]:
    """What did not hold, in the order of ticks."""
    found: list[judged.Wrong] = []
    gaps = np.flatnonzero(np.diff(rows[:, COLUMN["tick"]]) != 1.0)
    if len(gaps):
        found.append((int(rows[gaps[0], COLUMN["tick"]]), "a tick is missing in the recorder's rows"))
    faulty = np.flatnonzero((rows[:, COLUMN["mode"]] == Mode.FAULT) | (rows[:, COLUMN["fault"]] != 0.0))
    sound = rows[: faulty[0]] if len(faulty) else rows
    asked_for = any(Request.ESTOP.name in one for one in bench.told)
    if len(faulty) and not of.script and not asked_for:
        row = rows[faulty[0]]
        found.append(
            (int(row[COLUMN["tick"]]), f"a fault out of nothing: {Fault(int(row[COLUMN['fault']])).name}")
        )
    if not of.script and (silent := np.flatnonzero(sound[:, COLUMN["sync_sent"]] == 0.0)).size:
        found.append((int(sound[silent[0], COLUMN["tick"]]), "a tick sent no SYNC, and nothing was late"))
    found += judged.limits(of.machine, sound) + judged.counts(of.machine, sound)
    found += judged.path(of.program, bench.machine, sound, bench.start.joints, IN_SPINDLE)
    if of.script:
        found += [(first + int(one.split()[1].rstrip(":")), one) for one in wrongs(bench.observer.sight)]
    return sorted(found)
