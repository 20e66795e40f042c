"""What the guide says of a machine in any state: it can be done, and it leads to motion."""

from __future__ import annotations

import random
from collections import Counter
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import done, engine_of, heard, served
from support.machines.stepped_runs import shipped

from controller import messages
from controller.commands.table import SWITCHED
from controller.ipc.control_socket import CommandRefused
from controller.machine.tool_store import Step, placed
from controller.messages import message
from controller.plan.restart.program_position import Spot
from controller.service import jobs, journal, kept_file, sequences
from controller.service.command_handlers import CommandHandlers
from controller.service.sequencer import Sequence
from controller.service.thread_guard import InThread
from controller.service.watchdog import Pulse
from controller.state.modes import ALL_AXES, Fault, Mode, Request

TEXT = "G21 G90 G54\nG1 X10. F3000\nG1 X20.\nM30\n"
QUESTIONS = ("worn", "unrecorded")  # that a start asks before it begins
STEPS = 8  # from anything to motion
MODES = (*(Mode.OFF, Mode.READY, Mode.HOLD) * 3, *Mode)
INTERLOCKS = (*(Fault.NONE,) * 8, Fault.DOOR_OPEN, Fault.ESTOP_INPUT)
HELD_BY = (*(Fault.NONE,) * 4, Fault.INPUT_MISSING, Fault.PROBE_OPEN, Fault.DOOR_OPEN)


class Scene:
    """A service of the shop's machine, put into a state that is drawn."""

    def __init__(self, folder: Path) -> None:
        self.service = served(folder, shipped("shop"))
        self.desk, self.engine = CommandHandlers(self.service), engine_of(self.service)
        self.file = self.service.state / "part.ngc"
        self.file.write_text(TEXT)
        self.seconds = [0.0]
        self.service.processes.pulse = Pulse(lambda: self.seconds[0])
        self.engine.answers |= {"home": self._home, "return": self._returned}
        self.engine.aside = True
        self._ask_tick, self.engine.request = self.engine.request, self._request  # type: ignore[method-assign]
        assert self.service.changer is not None
        self.changer = self.service.changer
        self._new = self.engine.now

    def anew(self) -> None:
        """Powered up and ready; nothing is loaded, and all tools are where they belong."""
        service, engine = self.service, self.engine
        service.run.job = service.run.loaded = service.run.interrupted = service.run.recorder.record = (
            service.journal.last
        ) = None
        service.thread.found = service.sequencer.now = None
        service.alarms.acknowledge(None)
        service.processes.commissioned = engine.tick_alive = engine.plan_alive = True
        self.changer.arm()
        machine = service.set_up.machine.changer
        assert machine is not None
        self.changer.store.confirm(placed(machine.pockets, 0, ()))
        engine.now = self._new._replace(tick=engine.now.tick + 1, answers=engine.now.answers)

    def _home(self, **_: Any) -> dict[str, Any]:
        self.engine.now = self.engine.now._replace(homed=ALL_AXES, untrusted=0)
        return {}

    def _request(self, request: Request, value: float = 0.0) -> int:
        """The drives follow at once."""
        number = self._ask_tick(request, value)
        if request is Request.ENABLE:
            self.engine.now = self.engine.now._replace(mode=Mode.READY)
        return number

    def _returned(self, **_: Any) -> dict[str, Any]:
        heard(self.service, finished=False)
        return {}

    def draw(self, draw: random.Random) -> None:
        self.anew()
        service, engine = self.service, self.engine
        mode = draw.choice(MODES)
        if draw.random() < 0.7:
            done(self.desk, "load", path=str(self.file))
        if mode in (Mode.RUNNING, Mode.HOLD, Mode.STOPPING):
            self._start(draw)
        engine.now = engine.now._replace(
            mode=mode,
            at_rest=mode in (Mode.OFF, Mode.READY) or draw.random() < 0.9,
            homed=draw.choice((ALL_AXES, ALL_AXES, 0b10110, 0))
            if mode in (Mode.OFF, Mode.READY)
            else ALL_AXES,
            untrusted=draw.choice((0, 0, 0, 0b00100)) if mode in (Mode.OFF, Mode.READY) else 0,
            interlock=draw.choice(INTERLOCKS),
            fault=Fault.EMERGENCY_STOP if mode is Mode.FAULT else Fault.NONE,
            away=mode is Mode.HOLD and draw.random() < 0.2,
            switched=SWITCHED[Request.SINGLE_BLOCK].bit if draw.random() < 0.2 else 0,
            motion_id=draw.choice((-1, 3)),
            waiting=mode is Mode.RUNNING and draw.random() < 0.3,
            feed_stopped=mode is Mode.RUNNING and draw.random() < 0.2,
        )
        if mode is Mode.HOLD:
            engine.now = engine.now._replace(fault=draw.choice(HELD_BY))
        service.processes.commissioned = draw.random() < 0.9
        self._beside(draw)

    def _start(self, draw: random.Random) -> None:
        """A program, or a line by hand."""
        text = draw.random() < 0.3 or self.service.run.loaded is None
        done(self.desk, "mdi", text="G1 X1 F100") if text else done(self.desk, "start")
        heard(self.service, finished=False, aside=draw.random() < 0.2)
        if draw.random() < 0.2 and self.service.run.job is not None:
            self.service.run.job.tools = ()

    def _beside(self, draw: random.Random) -> None:
        """What the service knows besides the tick."""
        service, changer, running = self.service, self.changer, self.service.run.job
        if running is None and draw.random() < 0.1:
            changer.store.forget()
        elif running is None and draw.random() < 0.1:
            changer.store.begin(Step(0, 2, 1, "Over it", 2, 2))
        if draw.random() < 0.1:
            service.alarms.add(kept_file.ALARM, message("file_damaged", file="usage", why="?", aside="-"))
        if draw.random() < 0.15:
            service.thread.found = InThread(draw.choice((4.0, 0.0)), draw.choice((1.0, 0.0)), 7, "plate.ngc")
        job = service.run.loaded
        if job is not None and running is None:
            job.state = draw.choice(
                ("loaded", "loaded", "completed", "stopped", "fault", "refused", "loading")
            )
            job.said = message("not_homed", axes="X") if draw.random() < 0.3 else None
        if draw.random() < 0.3:
            self._interrupted()
        if draw.random() < 0.2:
            name = draw.choice(("return", "withdraw", "power up", "home"))
            service.sequencer.now = Sequence(name, "failed", message("not_homed", axes="X"))
        self.engine.plan_alive = draw.random() < 0.95
        if draw.random() < 0.05:
            self.engine.tick_alive = False

    def _interrupted(self) -> None:
        machine = self.service.set_up.machine
        job = journal.Job.of("part.ngc", TEXT.encode(), machine, jobs.homed_position(machine))
        known = (40.0, 100.0, 47.5, None)
        entry = journal.Entry(job, Spot(3, 0.5, 7, 12.0), True, 1, "READY", "NONE", 31, 0.0, False, *known)
        self.service.journal.last = entry

    def put_right(self, step: dict[str, Any]) -> None:
        """What somebody does by hand, or waits for."""
        engine = self.engine
        if step["place"] == "programs":
            done(self.desk, "load", path=str(self.file))
        if step["place"] == "alarms":
            self.service.alarms.acknowledge(None)
        engine.plan_alive = True
        engine.now = engine.now._replace(interlock=Fault.NONE, at_rest=True)
        if engine.now.mode in (Mode.HOMING, Mode.JOG, Mode.STOPPING):
            engine.now = engine.now._replace(mode=Mode.READY)
        if engine.now.mode is Mode.READY and self.service.run.job is not None:
            self.service.run.job.state, self.service.run.job = "stopped", None
        if self.service.run.loaded is not None and self.service.run.loaded.state == "loading":
            self.service.run.loaded.state = "loaded"

    def ask(self, step: dict[str, Any]) -> None:
        """As whoever is led: what the verb must be told besides is filled in."""
        more: dict[str, Any] = {}
        if step["verb"] == "changer_confirm":
            more = {"spindle": 0, "away": [], "clear": True}
        if step["verb"] == "load":
            more = {"path": str(self.file)}
        answer = self.desk(step["verb"], {**step["args"], **more})
        if isinstance(answer, Future):
            answer.result(60.0)


def offered_and_asked(folder: Path, seed: int, count: int, monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """The guide is followed by one step from so many states; how often which was told."""
    scene, draw, told = Scene(folder), random.Random(seed), Counter[str]()
    monkeypatch.setattr(sequences, "start_engine", lambda _: setattr(scene.engine, "tick_alive", True))
    for number in range(count):
        scene.draw(draw)
        status = done(scene.desk, "status")
        step = status["next"]
        told[step["key"]] += 1
        for language in messages.LANGUAGES:
            words = messages.text(messages.Message(key=step["key"], values=step["values"]), language)
            assert words and "{" not in words and words != step["key"], step
        assert not (step["verb"] and step["waits"])
        if step["verb"]:
            try:
                scene.ask(step)
            except CommandRefused as error:
                assert error.code in QUESTIONS, (seed, number, step, status["mode"], error.sentence)
    return told


def test_what_the_guide_offers_is_not_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = offered_and_asked(tmp_path, 41, 150, monkeypatch)
    assert len(told) > 20, told


def test_whoever_follows_the_guide_comes_to_a_motion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From any state, by what it says alone."""
    scene, draw = Scene(tmp_path), random.Random(42)
    monkeypatch.setattr(sequences, "start_engine", lambda _: setattr(scene.engine, "tick_alive", True))
    for number in range(60):
        scene.draw(draw)
        way = list[str]()
        while scene.engine.now.mode is not Mode.RUNNING and len(way) <= STEPS:
            step = done(scene.desk, "status")["next"]
            way.append(step["key"])
            if step["key"] in ("next.held", "next.program_stop", "next.single", "next.hold_fault"):
                break  # Resume, and it goes on
            scene.ask(step) if step["verb"] else scene.put_right(step)
            scene.service.watch.look()
        assert len(way) <= STEPS, (number, way)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_what_it_offers_is_not_refused_in_a_thousand_states(
    tmp_path: Path, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    offered_and_asked(tmp_path, seed, 1000, monkeypatch)


def test_a_start_is_offered_where_it_starts_and_says_with_what(tmp_path: Path) -> None:
    """Of all states that are drawn: one in which a start can be made is told so, and no other one."""
    scene, draw, can = Scene(tmp_path), random.Random(43), 0
    for number in range(100):
        scene.anew() if number % 3 == 0 else scene.draw(draw)
        if number % 3 == 0:
            done(scene.desk, "load", path=str(scene.file))
        if scene.engine.now.mode is Mode.HOLD or not (
            scene.engine.plan_alive and scene.service.processes.commissioned
        ):
            continue  # a start is a resume there; plan and drives are there before it
        status = done(scene.desk, "status")
        can += status["can_start"]
        if status["can_start"]:
            words = messages.text(status["job"]["starts"])
            assert words == "part.ngc from line 1, with an empty spindle and G54", words
        try:
            scene.ask({"verb": "start", "args": {}})
            started = True
        except CommandRefused as error:
            started = error.code in QUESTIONS
        refused_before = status["job"] is not None and status["job"]["key"] is not None
        if not refused_before:
            assert started is status["can_start"], (number, status["next"], status["mode"])
    assert can > 20
