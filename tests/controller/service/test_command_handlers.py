"""What is asked for while something else is under way, without any process."""

from __future__ import annotations

import contextlib
import math
import re
import threading
import time
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import HANGS_S, FakeEngine, done, heard, served

from controller import messages
from controller.ipc import control_socket
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Snapshot
from controller.machine import setup_data
from controller.machine.kinematics import kinematics_of
from controller.machine.model import AdaptiveFeed, Spindle
from controller.messages import message
from controller.plan.restart.program_position import FORMER, Spot
from controller.service import acknowledged, jobs, journal, sequences, whole_status
from controller.service.command_handlers import CommandHandlers
from controller.service.service import Service
from controller.service.set_up import Fitted
from controller.service.thread_guard import InThread
from controller.service.watchdog import LastSecond, Pulse
from controller.state.modes import Fault, Mode, Request, sentence
from controller.state.requests import Outcome, answer
from controller.store import history, set_up_store

TEXT = "G21 G90 G54\nG1 X10. F3000\nG1 X20.\nM30\n"
TOOL = {"number": 2, "name": "", "radius_mm": 1.4, "length_mm": 8.0, "flute_mm": 15.0}


def loaded(desk: CommandHandlers, service: Service, **more: Any) -> None:
    path = service.state / "part.ngc"
    path.write_text(TEXT)
    done(desk, "load", path=str(path), **more)


def held(desk: CommandHandlers, service: Service, engine: FakeEngine) -> None:
    loaded(desk, service)
    done(desk, "start")
    done(desk, "hold")
    assert engine.now.mode is Mode.HOLD


def ended(service: Service, engine: FakeEngine) -> None:
    """The tick has come to the program's end, and that was seen."""
    service.watch.look()
    engine.now = engine.now._replace(mode=Mode.READY)
    heard(service, finished=True, whole=True)
    service.watch.look()


@pytest.mark.parametrize("verb", ["retract", "return"])
def test_a_hold_while_a_way_is_planned_is_done_and_nothing_moves(
    desk: CommandHandlers, service: Service, engine: FakeEngine, verb: str
) -> None:
    held(desk, service, engine)
    planning, go = threading.Event(), threading.Event()

    def plan(**_: Any) -> dict[str, Any]:
        planning.set()
        go.wait(HANGS_S)
        return {}

    engine.answers[verb] = plan
    heard(service, aside=verb == "return")
    way = desk(verb, {"mm": 5.0})
    assert planning.wait(HANGS_S)
    told = done(desk, "hold")
    assert (told["mode"], told["outcome"], told["what"]) == ("HOLD", "given_up", verb)
    go.set()
    assert isinstance(way, Future)
    way.result(HANGS_S)
    assert Request.RESUME not in engine.requests and engine.now.mode is Mode.HOLD


@pytest.mark.parametrize("word", ["hold", "stop"])
@pytest.mark.parametrize("verb", ["retract", "start"])
def test_a_hold_or_stop_at_the_last_moment_comes_behind_what_it_is_to_stop(
    desk: CommandHandlers, service: Service, engine: FakeEngine, verb: str, word: str
) -> None:
    """What goes out and what gives it up cannot pass each other: the tick takes both, in that order."""
    if verb == "start":
        loaded(desk, service)
    else:
        held(desk, service, engine)
    others: list[threading.Thread] = []

    def at_the_last_moment(request: Request) -> None:
        if request in (Request.START, Request.RESUME):
            engine.before_request = lambda _: None
            others.append(threading.Thread(target=done, args=(desk, word)))
            others[0].start()
            others[0].join(0.05)
            assert others[0].is_alive(), "it waits until that is out"

    engine.before_request = at_the_last_moment
    asked = desk(verb, {"mm": 5.0} if verb == "retract" else {})
    assert isinstance(asked, Future)
    with contextlib.suppress(CommandRefused):
        asked.result(HANGS_S)
    others[0].join(HANGS_S)
    assert engine.now.mode is (Mode.HOLD if word == "hold" else Mode.READY)
    first = Request.START if verb == "start" else Request.RESUME
    assert engine.requests[-2:] == [first, Request[word.upper()]]


def test_a_stop_while_a_start_is_planned_is_the_end_of_it_and_nothing_goes_out(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    loaded(desk, service)
    arm, planning, go = engine.answers["arm"], threading.Event(), threading.Event()

    def plan(**more: Any) -> dict[str, Any]:
        planning.set()
        go.wait(HANGS_S)
        return arm(**more)

    engine.answers["arm"] = plan
    start = desk("start", {})
    assert planning.wait(HANGS_S) and isinstance(start, Future)
    assert done(desk, "hold")["outcome"] == "given_up"
    go.set()
    with pytest.raises(CommandRefused, match="stopped before it began"):
        start.result(HANGS_S)
    assert Request.START not in engine.requests and service.run.job is None
    told = whole_status.status(service)
    assert told["can_start"] and told["next"]["verb"] == "start", "nothing is to be put right"
    assert told["job"]["elapsed_s"] is None


def test_what_runs_is_not_offered_to_be_gone_on_with(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    interrupted(service)
    assert done(desk, "restart")["offered"]
    loaded(desk, service, restart=True)
    done(desk, "start")
    for mode in (Mode.RUNNING, Mode.HOLD):
        assert engine.now.mode is mode
        offer = done(desk, "restart")
        assert (offer["offered"], offer["key"]) == (False, "running")
        with pytest.raises(CommandRefused, match="is running; stop it"):
            done(desk, "load", restart=True, path=str(service.state / "part.ngc"))
        if mode is Mode.RUNNING:
            done(desk, "hold")


def test_a_reset_waits_until_the_run_is_told_to_be_over_by_the_fault(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    """All of it had been sent: in OFF it would be told as completed, and a client could not home at once."""
    loaded(desk, service)
    done(desk, "start")
    service.watch.look()
    heard(service, finished=True, whole=True)
    engine.now = engine.now._replace(mode=Mode.FAULT, fault=Fault.ESTOP_INPUT)
    asked = desk("reset", {})
    assert isinstance(asked, Future)
    time.sleep(0.2)
    assert Request.RESET not in engine.requests and service.run.loaded is not None
    service.watch.look()
    asked.result(HANGS_S)
    assert Request.RESET in engine.requests
    service.watch.look()
    assert (service.run.loaded.state, service.run.job) == ("fault", None)


@pytest.mark.parametrize("then", ["load", "unload"])
def test_a_check_that_nobody_wants_any_more_bars_neither_the_next_program_nor_anything_else(
    then: str, desk: CommandHandlers, service: Service, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    good, checking, given_up = engine.answers["check"], threading.Event(), threading.Event()

    def check(**more: Any) -> dict[str, Any]:
        if b"X9" not in more["program"].text:
            return good(**more)
        checking.set()
        assert given_up.wait(HANGS_S)
        raise CommandRefused("refused", messages.message("given_up", verb="check"))

    engine.answers["check"] = check
    monkeypatch.setattr(engine, "give_up", given_up.set)
    large, other, another = (service.state / f"{name}.ngc" for name in ("large", "other", "another"))
    large.write_text("G21\nG0 X9\nM30\n")
    for file in (other, another):
        file.write_text(TEXT)
    first = desk("load", {"path": str(large)})
    assert checking.wait(HANGS_S) and isinstance(first, Future)
    with pytest.raises(CommandRefused, match="load"):
        done(desk, "home")
    asked = [desk(then, {"path": str(file)}) for file in (other, another)]
    with pytest.raises(CommandRefused, match="given up"):
        first.result(HANGS_S)
    last = asked[-1].result(HANGS_S) if isinstance(asked[-1], Future) else asked[-1]
    assert (service.run.loaded.program.name if service.run.loaded else None) == (
        last["name"] if then == "load" else None
    )
    assert then == "unload" or (last["name"], service.run.loaded.state) == ("another.ngc", "loaded")  # type: ignore[union-attr]
    assert service.sequencer.now is not None and service.sequencer.now.state == "done"


def test_a_stop_between_two_groups_that_home_ends_the_homing_and_nothing_is_enabled(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    """The machine is off just then, and would move again within a moment."""
    homing, go = threading.Event(), threading.Event()

    def home(**_: Any) -> dict[str, Any]:
        homing.set()
        go.wait(HANGS_S)
        return {}

    engine.answers["home"] = home
    engine.now = engine.now._replace(mode=Mode.OFF)
    asked = desk("home", {})
    assert homing.wait(HANGS_S) and isinstance(asked, Future)
    with pytest.raises(CommandRefused, match="HOLD is refused in OFF"):
        done(desk, "hold")
    told = done(desk, "stop")
    assert (told["outcome"], told["what"], engine.given_up) == ("given_up", "home", 1)
    go.set()
    with pytest.raises(CommandRefused, match="stopped"):
        asked.result(HANGS_S)
    assert Request.ENABLE not in engine.requests and engine.now.mode is Mode.OFF


def test_a_refusal_is_of_the_request_that_was_refused_and_of_no_later_one(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    """Seen on a bench: the second ENABLE answered with the door of the first, while the drives came up."""
    engine.now = engine.now._replace(mode=Mode.OFF)
    request, open_door = engine.request, Fault.ESTOP_INPUT

    def refusing(asked: Request, value: float = 0.0) -> int:
        if asked is not Request.ENABLE:
            return request(asked, value)
        engine.number += 1
        came = answer(engine.number, Outcome.REFUSED, open_door)
        engine.now = engine.now._replace(answers=(*engine.now.answers[1:], came))
        return engine.number

    engine.request = refusing  # type: ignore[method-assign]
    with pytest.raises(CommandRefused) as error:
        done(desk, "enable")
    assert (error.value.mode, error.value.request) == ("OFF", "ENABLE")
    assert error.value.sentence == sentence(Fault.ESTOP_INPUT)
    engine.request = request  # type: ignore[method-assign]
    number = request(Request.ENABLE)
    engine.now = engine.now._replace(mode=Mode.READY)
    assert engine.now.came_of(number)[0] is Outcome.DONE and done(desk, "enable")["done"]


def test_every_request_is_answered_as_what_came_of_it_and_not_as_the_mode_suggests(
    desk: CommandHandlers, engine: FakeEngine
) -> None:
    """The tick refuses what its table would take: it knows more than the snapshot that was seen last."""
    engine.now = engine.now._replace(mode=Mode.RUNNING)
    told = done(desk, "override", share=0.5)
    assert (told["outcome"], told["share"], told["mode"]) == ("done", 0.5, "RUNNING")
    engine._answer, take = lambda came: take(Outcome.REFUSED), engine._answer  # type: ignore[method-assign]
    for verb in ("hold", "resume", "jog_stop", "disable"):
        with pytest.raises(CommandRefused) as error:
            done(desk, verb)
        assert error.value.request


def test_a_tick_that_answers_nothing_is_told_and_keeps_nobody_waiting(
    desk: CommandHandlers, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(acknowledged, "LONGEST_S", 0.02)
    monkeypatch.setattr(engine, "request", lambda request, value=0.0: 77)
    asked = desk("hold", {})
    assert isinstance(asked, Future), "the door's thread goes on"
    with pytest.raises(CommandRefused) as error:
        asked.result(HANGS_S)
    assert (
        error.value.code == "silent" and error.value.request == "HOLD" and error.value.said["key"] == "waited"
    )
    asked = desk("stop", {})
    engine.tick_alive = False
    assert isinstance(asked, Future)
    with pytest.raises(CommandRefused):
        asked.result(HANGS_S)


def at(engine: FakeEngine, **degrees: float) -> None:
    """The axes stand 60 mm lower, with the rotaries turned."""
    machine = engine.machine
    joints = [
        q + (-60.0 if axis.name == "Z" else math.radians(degrees.get(axis.name, 0.0)))
        for axis, q in zip(machine.axes, engine.now.joints, strict=True)
    ]
    engine.now = engine.now._replace(joints=tuple(joints), actual=tuple(joints))


def gone(engine: FakeEngine, before: Snapshot) -> tuple[float, float]:
    """How far (mm) the tool's gauge line went along its own axis, and across it."""
    kinematics = kinematics_of(engine.machine)
    (there, axis), (here, _) = (kinematics.forward(q.joints, 0.0) for q in (engine.now, before))
    way = [float(p - q) for p, q in zip(there, here, strict=True)]
    along = sum(w * float(a) for w, a in zip(way, axis, strict=True))
    return along, math.hypot(*(w - along * float(a) for w, a in zip(way, axis, strict=True)))


def test_from_ready_as_after_a_fault_the_tool_goes_off_along_its_axis_slowly(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    at(engine, A=35.0, C=-20.0)
    before, room = engine.now, done(desk, "status")["retract_room_mm"]
    assert done(desk, "retract", mm=12.5)["mm"] == pytest.approx(12.5)
    assert gone(engine, before) == pytest.approx((12.5, 0.0), abs=1e-9)
    (line,) = engine.jogged
    assert line.length == 12.5 and 0.0 < line.speed <= 10.0, "no faster than out of a held program"
    after = done(desk, "status")["retract_room_mm"]
    assert after == pytest.approx(room - 12.5, abs=2e-3)
    done(desk, "retract", mm=after)  # what is told may be asked for
    with pytest.raises(CommandRefused, match=r"up to 0\.000 mm") as error:
        done(desk, "retract", mm=0.1)
    assert error.value.mode == "READY" and "0.000 mm im Verfahrweg" in messages.text(error.value.said, "de")


@pytest.mark.parametrize("mm", [999.0, 1000.0])
def test_a_retract_that_cannot_be_is_refused_with_how_far_it_could_go(
    desk: CommandHandlers, service: Service, engine: FakeEngine, mm: float
) -> None:
    at(engine)
    room = done(desk, "status")["retract_room_mm"]
    with pytest.raises(CommandRefused, match=f"up to {room:.3f} mm"):
        done(desk, "retract", mm=mm)
    held(desk, service, engine)
    with pytest.raises(CommandRefused, match=f"up to {room:.3f} mm"):
        done(desk, "retract", mm=mm)
    assert not engine.jogged and "retract" not in engine.orders


def test_no_retract_where_the_tool_axis_is_not_known_or_a_door_is_open(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    at(engine)
    good = engine.now
    engine.now = good._replace(homed=0b10111, untrusted=0b01000)
    assert done(desk, "status")["retract_room_mm"] is None
    with pytest.raises(CommandRefused, match="A is homed"):
        done(desk, "retract", mm=5.0)
    engine.now = good._replace(interlock=Fault.DOOR_OPEN)
    with pytest.raises(CommandRefused, match="The door is open"):
        done(desk, "retract", mm=5.0)
    engine.now = good._replace(mode=Mode.FAULT)
    with pytest.raises(CommandRefused, match="reset and enable"):
        done(desk, "retract", mm=5.0)
    assert not engine.jogged


def test_a_retract_that_something_ends_too_early_is_no_success(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    at(engine)
    engine.jog_ends_mm = 3.0
    with pytest.raises(CommandRefused, match=r"after 3\.000 of 8\.000 mm"):
        done(desk, "retract", mm=8.0)


def leaves(value: Any) -> list[Any]:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return [value] if inner is None else [leaf for one in inner for leaf in leaves(one)]


def test_of_a_tick_that_was_killed_in_a_cut_the_very_next_status_tells(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    """Nobody has looked since: no alarm is there yet, and nothing of the cut is told to go on."""
    loaded(desk, service)
    done(desk, "start")
    actual = tuple(q + 0.25 for q in engine.now.joints)
    engine.now = engine.now._replace(actual=actual, at_rest=False, rate=1.0)
    before = done(desk, "status")
    engine.tick_alive = False
    now = done(desk, "status")
    assert (before["mode"], before["job"]["state"], before["fault"]) == ("RUNNING", "running", None)
    assert (now["mode"], now["job"]["state"], now["tick_alive"]) == ("FAULT", "fault", False)
    assert now["fault"]["name"] == "CONTROLLER_GONE" and not now["fault"]["position_trusted"]
    assert messages.text(now["fault"])
    assert now["at_rest"] is None and now["feed_mm_min"]["actual"] is None and now["retract_room_mm"] is None
    assert now["not_homed"] == ["X", "Y", "Z", "A", "C"]
    assert now.keys() == before.keys()
    for axis, joint in now["joints"].items():
        assert joint["actual"] == before["joints"][axis]["actual"], "where it was heard last"
        assert (joint["homed"], joint["to_go"], joint["error"]) == (False, None, None)
    assert {drive["state"] for drive in now["drives"]} == {None}
    service.watch.look()
    shown = done(desk, "status")["fault"]
    assert shown["number"] == service.alarms.list()[0]["id"], "and then with its alarm"


@pytest.mark.parametrize("alive", [True, False])
@pytest.mark.parametrize("never", [True, False])
def test_before_the_first_tick_every_field_is_there_and_nothing_is_known(
    desk: CommandHandlers,
    service: Service,
    engine: FakeEngine,
    monkeypatch: pytest.MonkeyPatch,
    alive: bool,
    never: bool,
) -> None:
    full = done(desk, "status")
    none = None if never else engine.now._replace(tick=-1)
    monkeypatch.setattr(engine, "snapshot", lambda: none)
    engine.tick_alive = alive
    now = done(desk, "status")
    assert now.keys() == full.keys() and now["joints"].keys() == full["joints"].keys()
    assert (now["mode"], now["tick_alive"], now["not_homed"]) == ("OFF", alive, ["X", "Y", "Z", "A", "C"])
    for key in ("joints", "feed_mm_min", "spindle", "tick", "tip", "override", "at_rest", "limited_by"):
        assert set(leaves(now[key])) == {None} and leaves(now[key]), key
    assert [drive["axis"] for drive in now["drives"]] == ["X", "Y", "Z", "A", "C"]


def test_a_tick_that_stands_is_a_fault_within_a_second_and_once_an_alarm(
    desk: CommandHandlers, service: Service, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of what the status says in that time only positions stay; it goes on where the tick does."""
    seconds = [0.0]
    service.processes.pulse = Pulse(lambda: seconds[0])
    loaded(desk, service)
    done(desk, "start")
    frozen = engine.now
    monkeypatch.setattr(engine, "snapshot", lambda: frozen)
    service.watch.look()
    for now_s in (0.1, 0.4):
        seconds[0] = now_s
        service.watch.look()
        told = done(desk, "status")
        assert (told["mode"], told["fault"], told["tick"]["age_s"]) == ("RUNNING", None, pytest.approx(now_s))
        assert not service.alarms.list()
    seconds[0] = 0.999
    told = done(desk, "status")
    assert (told["mode"], told["fault"]["name"], told["tick_alive"]) == ("FAULT", "TICK_STANDS", True)
    assert "1.0 s" in messages.text(told["fault"]) and not told["fault"]["position_trusted"]
    assert told["at_rest"] is None and told["retract_room_mm"] is None
    assert told["not_homed"] == ["X", "Y", "Z", "A", "C"] and told["job"]["state"] == "stopping"
    service.watch.look()
    service.watch.look()
    assert [alarm["name"] for alarm in service.alarms.list()] == ["TICK_STANDS"]
    frozen = frozen._replace(tick=frozen.tick + 1)
    service.watch.look()
    told = done(desk, "status")
    assert (told["mode"], told["fault"], told["tick"]["age_s"]) == ("RUNNING", None, 0.0)
    assert told["job"]["state"] == "running"
    seconds[0] = 2.0
    service.watch.look()
    assert len(service.alarms.list()) == 2, "it stands once more"


@pytest.mark.parametrize("mode", [Mode.READY, Mode.HOLD, Mode.OFF])
def test_of_a_tick_that_stands_nothing_is_asked_but_stops_and_a_reset_starts_another(
    desk: CommandHandlers, service: Service, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch, mode: Mode
) -> None:
    seconds, began = [0.0], list[int]()
    service.processes.pulse = Pulse(lambda: seconds[0])
    loaded(desk, service)
    frozen = engine.now._replace(mode=mode)
    monkeypatch.setattr(engine, "snapshot", lambda: frozen)
    monkeypatch.setattr(sequences, "start_engine", lambda _: began.append(engine.tick_alive))
    service.watch.look()
    seconds[0] = 1.0
    for verb in ("start", "home", "mdi", "jog_step", "resume", *(["enable"] if mode is Mode.OFF else [])):
        with pytest.raises(CommandRefused) as error:
            done(desk, verb, text="G0 X1", frame="joint", axis="X", distance=1.0)
        assert (error.value.mode, error.value.said["key"]) == ("FAULT", "tick_does_not_answer"), verb
    assert not engine.requests
    with contextlib.suppress(CommandRefused):  # no tick came of it here
        done(desk, "reset")
    assert began == [False], "the one that hung is gone before another begins"


def test_in_the_last_second_of_the_queue_the_operator_is_told_and_not_before(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    """The plan has more to send, and does not: the path goes on, and rests where the queue ends."""
    seconds = [0.0]
    service.watch.last_second = LastSecond(lambda: seconds[0])
    loaded(desk, service)
    done(desk, "start")
    heard(service, finished=False)

    def told(left_s: float, **more: Any) -> list[dict[str, Any]]:
        now_s = engine.now.plan_time_s
        engine.now = engine.now._replace(queue_end_s=now_s + left_s, at_rest=False, **more)
        seconds[0] += 0.15
        service.watch.look()
        notices: list[dict[str, Any]] = done(desk, "status")["notices"]
        return notices

    assert not told(2.5) and not told(1.01)
    assert not told(0.9), "where a program begins that is nothing"
    assert not told(0.8)
    (notice,) = told(0.7)
    assert notice["name"] == "PLAN_SILENT" and "0.7 s" in messages.text(notice)
    assert not told(2.0), "it has sent again"
    assert not service.alarms.list()
    for _ in range(3):
        told(0.5)
    assert told(0.4)
    heard(service, finished=True, whole=True)
    assert not told(0.3) and not told(0.2), "it is the program's own end"


def test_a_plan_that_is_killed_in_a_hold_is_a_fault_with_one_alarm(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    held(desk, service, engine)
    service.watch.look()
    engine.plan_alive = False
    service.watch.look()
    assert Request.STOP not in engine.requests and engine.now.mode is Mode.FAULT
    service.watch.look()
    now = done(desk, "status")
    assert (now["mode"], now["fault"]["name"]) == ("FAULT", "PLANNER_GONE")
    (alarm,) = service.alarms.list()
    assert (alarm["name"], now["fault"]["number"]) == ("PLANNER_GONE", alarm["id"])
    assert service.run.job is None and service.run.loaded is not None
    assert service.run.loaded.state == "fault"
    assert messages.text(service.run.loaded.said) == messages.text(now["fault"])


def test_a_later_death_of_the_plan_is_another_alarm(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    for so_many in (1, 2):
        held(desk, service, engine)
        service.watch.look()
        engine.plan_alive = False
        service.watch.look()
        service.watch.look()
        assert len(service.alarms.list()) == so_many
        mended = threading.Event()
        service.sequencer.later(mended.set)
        assert mended.wait(HANGS_S), "the other plan"
        engine.now = engine.now._replace(mode=Mode.READY, fault=Fault.NONE)
        service.watch.look()


def test_a_hold_right_behind_a_resume_is_sent_although_no_snapshot_shows_that_it_runs(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    held(desk, service, engine)
    assert done(desk, "resume")["outcome"] == done(desk, "hold")["outcome"] == "done"
    assert engine.requests[-2:] == [Request.RESUME, Request.HOLD] and engine.now.mode is Mode.HOLD
    with pytest.raises(CommandRefused, match="HOLD is refused in HOLD"):
        done(desk, "hold")


def test_a_stop_is_sent_though_the_plan_that_prepares_a_start_is_gone(
    desk: CommandHandlers, service: Service, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded(desk, service)
    sent: list[Request] = []

    def gone(*_: Any, **__: Any) -> dict[str, Any]:
        raise CommandRefused("gone", "The planner is gone.")

    def plan(**_: Any) -> dict[str, Any]:
        monkeypatch.setattr(engine, "give_up", gone)
        desk("stop", {})
        sent.extend(engine.requests)
        return gone()

    engine.answers["arm"] = plan
    with pytest.raises(CommandRefused, match="planner is gone"):
        done(desk, "start")
    assert sent == [Request.STOP]


def test_a_start_on_a_full_disk_is_confirmed_costs_the_record_and_the_program_ends_as_ever(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    loaded(desk, service)
    (service.state / "runs").write_text("no folder can be made here")
    with pytest.raises(CommandRefused, match=r"is not recorded and cannot be gone on with: .*runs: "):
        done(desk, "start")
    assert service.alarms.list() == [] and engine.now.mode is Mode.READY
    done(desk, "start", unrecorded=True)
    ended(service, engine)
    assert (
        service.run.job is None and service.run.loaded is not None and service.run.loaded.state == "completed"
    )
    (alarm,) = service.alarms.list()
    assert alarm["name"] == "NOT_RECORDED" and alarm["key"] == "not_recorded"
    (notice,) = done(desk, "status")["notices"]  # for where the disk takes no alarm either
    assert notice == {"name": "NOT_RECORDED", **message("not_recorded", **alarm["values"])}
    (service.state / "runs").unlink()
    done(desk, "start", unrecorded=True)
    assert done(desk, "status")["notices"] == [], "this one is recorded"


def test_a_disk_that_fills_during_a_run_is_told_once(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    loaded(desk, service)
    done(desk, "start")
    assert service.run.recorder.record is not None and service.run.recorder.record._file is not None
    service.run.recorder.record.began, service.run.recorder.record._file.problem = (
        True,
        "No space left on device",
    )
    for _ in range(3):
        service.run.take_rows(engine.now)
    (alarm,) = service.alarms.list()
    assert messages.text(alarm).startswith(
        "The record of part.ngc ends before the run: No space left on device"
    )
    ended(service, engine)


def test_a_run_is_told_to_be_over_when_what_it_forbids_is_allowed_again_and_not_before(
    desk: CommandHandlers, service: Service, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded(desk, service)
    done(desk, "start")
    job, told = service.run.job, list[str]()
    assert job is not None
    monkeypatch.setattr(service.troubles, "run_over", lambda: told.append(job.state))
    ended(service, engine)
    assert told and told[-1] != "completed" and job.state == "completed", "another may look at any time"


def test_a_start_that_meets_an_error_of_ours_does_not_bar_the_next(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    loaded(desk, service)
    good = engine.answers["arm"]
    engine.answers["arm"] = lambda **_: {}["start"]
    with pytest.raises(CommandRefused, match="KeyError"):
        done(desk, "start")
    assert service.run.job is None
    engine.answers["arm"] = good
    done(desk, "start")


def test_a_line_that_is_over_before_anybody_looks_has_been_run(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    engine.short = True

    def arm(**more: Any) -> dict[str, Any]:
        heard(service, finished=True, whole=True)
        return engine._arm(**more)

    engine.answers["arm"] = arm
    started = desk("mdi", {"text": "M5"})
    assert isinstance(started, Future)
    while not started.done() or service.run.job is not None:
        service.watch.look()
    assert started.result()["mode"] == "READY" and service.run.job is None
    seen = done(desk, "status")["run"]
    assert seen["id"] == started.result()["run"] and seen["result"] == "completed", "who waits finds it"


def test_what_a_plan_left_in_the_tick_when_it_died_is_dropped_before_the_next_start(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    loaded(desk, service)
    good = engine.answers["arm"]

    def dies(**_: Any) -> dict[str, Any]:
        engine.now = engine.now._replace(queue_end_s=5.0)
        engine.plan_alive = False
        raise CommandRefused("gone", "The planner is gone.")

    engine.answers["arm"] = dies
    with pytest.raises(CommandRefused):
        done(desk, "start")
    assert engine.requests == [Request.STOP] and engine.now.queue_end_s == 0.0
    engine.answers["arm"], engine.plan_alive = good, True
    engine.now = engine.now._replace(queue_end_s=5.0)  # a stop that never came to the tick
    done(desk, "start")
    assert engine.requests == [Request.STOP, Request.STOP, Request.START]


def test_two_changes_at_once_are_both_kept(
    desk: CommandHandlers, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    put, both = service.store.put, threading.Barrier(2, timeout=0.2)

    def slow(name: str, values: Any) -> None:
        with contextlib.suppress(threading.BrokenBarrierError):
            both.wait()  # each with what the other has not written yet, where they may
        put(name, values)

    monkeypatch.setattr(service.store, "put", slow)
    asked = [desk("set_offset", {"name": "G55", "values": [1.0, 2.0, 3.0]}), desk("set_tool", dict(TOOL))]
    for one in asked:
        assert isinstance(one, Future)
        one.result(HANGS_S)
    kept = set_up_store.load(service.state)
    assert kept["offsets"]["G55"] == [1.0, 2.0, 3.0] and kept["tools"]["2"]["length_mm"] == 8.0
    assert service.set_up.machine.offsets[1].origin == (1.0, 2.0, 3.0)
    tool = service.set_up.machine.tool(2)
    assert tool is not None and tool.length_mm == 8.0


def test_a_start_during_a_change_runs_with_what_was_changed(
    desk: CommandHandlers, service: Service, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded(desk, service)
    put, writing, go = service.store.put, threading.Event(), threading.Event()

    def slow(name: str, values: Any) -> None:
        writing.set()
        go.wait(HANGS_S)
        put(name, values)

    armed: list[Any] = []
    arm = engine.answers["arm"]
    engine.answers["arm"] = lambda **more: (armed.append(more["program"]), arm(**more))[1]
    monkeypatch.setattr(service.store, "put", slow)
    change = desk("set_offset", {"name": "G54", "values": [1.0, 2.0, 3.0]})
    assert writing.wait(HANGS_S)
    start = desk("start", {})
    go.set()
    assert isinstance(change, Future) and isinstance(start, Future)
    change.result(HANGS_S)
    start.result(HANGS_S)
    assert armed[0].machine.offsets[0].origin == (1.0, 2.0, 3.0)


def interrupted(service: Service) -> None:
    """The journal of a program that was stopped in line 3."""
    joints = jobs.homed_position(service.set_up.machine)
    job = journal.Job.of("part.ngc", TEXT.encode(), service.set_up.machine, joints)
    in_block = {"what": "line", "fraction": 0.25, "u": None}
    known = (40.0, 100.0, 47.5, in_block)  # s of a whole run before it, and in all; elapsed
    entry = journal.Entry(job, Spot(3, 0.5, 7, 12.0), True, 1, "READY", "NONE", 31, 0.0, False, *known)
    journal.write(entry, service.store)
    service.journal.last = entry


@pytest.mark.parametrize("then", ["load", "unload"])
def test_the_place_of_what_another_service_ran_is_told_until_a_program_is_loaded(
    then: str, desk: CommandHandlers, service: Service, tmp_path: Path
) -> None:
    interrupted(service)
    after = served(tmp_path)
    told = whole_status.status(after)
    job = told["job"]
    loaded(desk, service)
    assert service.run.loaded is not None
    assert set(job) == set(whole_status.status(service)["job"]), "as of one that is loaded"
    assert (job["name"], job["state"], job["line"], job["block"]) == ("part.ngc", "interrupted", 3, 7)
    assert (job["elapsed_s"], job["left_s"], job["duration_s"], job["fraction"]) == (47.5, 60.0, 100.0, 0.4)
    assert told["in_block"] == {"what": "line", "fraction": 0.25, "u": None} and told["tool"] == 1
    assert "line 3" in messages.text(job) and "Zeile 3" in messages.text(job, "de")
    with pytest.raises(CommandRefused, match="oad"):
        done(CommandHandlers(after), "start")
    if then == "load":
        loaded(CommandHandlers(after), after)
    else:
        done(CommandHandlers(after), "unload")
    now = whole_status.status(after)
    assert now["in_block"] is None and (now["job"] or {"state": "loaded"})["state"] == "loaded"


def test_what_holds_where_nobody_answers_any_more_is_on_disk(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    """Written only where something is other; a service that ends in order leaves no fault."""
    held(desk, service, engine)
    kept, there = whole_status.Kept(service), whole_status.status(service)
    kept.look(service.processes.now())
    told = control_socket.last_known(service.state, "status")
    joints = {name: row["machine"] for name, row in there["joints"].items()}
    assert {name: row["machine"] for name, row in told["joints"].items()} == joints
    assert set(told) == {*there, "gone_s"} and told["gone_s"] < HANGS_S
    assert (told["mode"], told["fault"]["key"], told["job"]["state"]) == ("FAULT", "service_gone", "fault")
    assert told["not_homed"] == list(joints) and told["job"]["line"] == there["job"]["line"]
    assert [axis["name"] for axis in control_socket.last_known(service.state, "facts")["axes"]] == list(
        joints
    )
    file = service.state / control_socket.LAST
    written = file.stat().st_ino
    kept.look(service.processes.now())
    assert file.stat().st_ino == written, "nothing but the tick is other"
    engine.now = engine.now._replace(joints=tuple([q + 1.0 for q in engine.now.joints]))
    kept.look(service.processes.now())
    assert file.stat().st_ino != written
    service.close()
    kept.close()
    told = control_socket.last_known(service.state, "status")
    assert (told["mode"], told["fault"], told["job"]["state"]) == ("OFF", None, "interrupted")


def test_what_calls_files_and_skips_lines_is_gone_on_with_as_it_was_begun(
    desk: CommandHandlers, service: Service, tmp_path: Path
) -> None:
    """The store knows a program by its file; what is run is that with what it calls, less what it skips."""
    file, called = service.state / "part.ngc", service.state / "holes.ngc"
    file.write_text("G21\n/G0 X9\no<holes> call\nG0 X1\nM30\n")
    called.write_text("o<holes> sub\nG0 X2\no<holes> endsub\n")
    how = {"path": str(file), "files": {"holes.ngc": str(called)}}
    done(desk, "load", block_delete=True, **how)
    assert service.run.loaded is not None
    entry = journal.Entry(
        jobs.journalled(service.run.loaded, service.set_up.machine),
        Spot(4, 0.5, 7, 12.0),
        True,
        1,
        "READY",
        "NONE",
        31,
        0.0,
        False,
    )
    journal.write(entry, service.store)
    after = served(tmp_path)
    assert whole_status.status(after)["job"]["block_delete"] is True
    offer = done(CommandHandlers(after), "restart")
    assert offer["offered"] and offer["sha256"] == journal.sha256(file.read_bytes())
    done(CommandHandlers(after), "load", restart=True, **how)
    assert after.run.loaded is not None and after.run.loaded.block_delete
    called.write_text("o<holes> sub\nG0 X3\no<holes> endsub\n")
    with pytest.raises(CommandRefused, match="the program changed"):
        done(CommandHandlers(after), "load", restart=True, **how)


def test_what_came_to_its_end_is_not_told_of_after_a_return(service: Service, tmp_path: Path) -> None:
    interrupted(service)
    entry = journal.read(service.store)
    assert entry is not None
    journal.write(replace(entry, ended=True), service.store)
    assert whole_status.status(served(tmp_path))["job"] is None


def test_a_restart_that_is_loaded_is_not_started_with_another_offset(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    interrupted(service)
    loaded(desk, service, restart=True)
    before = setup_data.offsets_of(service.set_up.machine)["G54"]["origin_mm"]
    done(desk, "set_offset", name="G54", values=[1.0, 2.0, 3.0])
    with pytest.raises(CommandRefused, match="a work offset changed") as error:
        done(desk, "start")
    assert (error.value.mode, error.value.request) == ("READY", "START")
    assert "arm" not in engine.orders and service.run.job is None
    done(desk, "set_offset", name="G54", values=before)
    done(desk, "start")


def test_a_restart_that_is_loaded_starts_with_another_tool_at_the_fraction_of_its_block(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    interrupted(service)
    loaded(desk, service, restart=True)
    assert service.run.loaded is not None and service.run.loaded.program.spot == Spot(3, 0.5, 7, 12.0)
    done(desk, "set_tool", **TOOL)
    done(desk, "start")
    assert service.run.loaded.program.spot == Spot(3, 0.5, FORMER)


def test_tools_do_not_change_while_the_way_back_is_planned_with_them(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    held(desk, service, engine)
    heard(service, aside=True)
    done(desk, "set_tool", **TOOL)
    said: list[CommandRefused] = []

    def plan(**_: Any) -> dict[str, Any]:
        with contextlib.suppress(CommandRefused):
            done(desk, "set_tool", **{**TOOL, "length_mm": 9.0})
            raise AssertionError("it was changed")
        said.append(CommandRefused("", ""))
        heard(service)
        engine.aside = True
        return {}

    engine.answers["return"] = plan
    done(desk, "return")
    assert said and service.run.job is not None
    tool = service.run.job.program.machine.tool(2)
    assert tool is not None and tool.length_mm == 8.0


def test_a_start_before_the_program_is_read_or_after_its_refusal_says_why_in_both_languages(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    reading, go = threading.Event(), threading.Event()

    def check(**_: Any) -> dict[str, Any]:
        reading.set()
        go.wait(HANGS_S)
        raise CommandRefused("bad", "part.ngc: line 2: X99. is beyond the travel.")

    engine.answers["check"] = check
    (service.state / "part.ngc").write_text(TEXT)
    load = desk("load", {"path": str(service.state / "part.ngc")})
    assert reading.wait(HANGS_S)
    with pytest.raises(CommandRefused, match=r"part\.ngc is still being read and checked; wait") as error:
        done(desk, "start")
    assert "wird noch gelesen" in messages.text(error.value.said, "de")
    go.set()
    assert isinstance(load, Future)
    with pytest.raises(CommandRefused):
        load.result(HANGS_S)
    with pytest.raises(CommandRefused, match=r"was not loaded.* X99\. is beyond the travel\.$") as error:
        done(desk, "start")
    assert messages.text(error.value.said, "de").endswith("beyond the travel.")
    job = done(desk, "status")["job"]
    assert job["state"] == "refused" and messages.text(job).endswith("beyond the travel.")


@pytest.mark.parametrize(
    ("axis", "end", "sign"), [("X", "travel_max", 1), ("X", "travel_min", -1), ("A", "travel_max", 1)]
)
def test_a_jog_into_a_soft_limit_says_that_it_will_not_move_and_why(
    desk: CommandHandlers, service: Service, engine: FakeEngine, axis: str, end: str, sign: int
) -> None:
    at(engine)
    index = [a.name for a in engine.machine.axes].index(axis)
    there = getattr(engine.machine.axes[index], end)
    joints = tuple([there if i == index else q for i, q in enumerate(engine.now.joints)])
    engine.now = engine.now._replace(joints=joints, actual=joints)
    shown = there * engine.machine.axes[index].shown_per_unit
    words = f"^{axis} will not move: it stands at its soft limit of {re.escape(f'{shown:g}')} (mm|deg)"
    for verb, args in (("jog", {"speed": 0.5 * sign}), ("jog_step", {"distance": 1.0 * sign})):
        with pytest.raises(CommandRefused, match=words) as error:
            done(desk, verb, axis=axis, frame="joint", **args)
        assert "bewegt sich nicht" in messages.text(error.value.said, "de") and not engine.jogged
    done(desk, "jog_step", axis=axis, frame="joint", distance=-1.0 * sign)
    assert len(engine.jogged) == 1, "away from the limit it moves"
    engine.now = engine.now._replace(joints=joints, actual=joints, homed=0, mode=Mode.READY)
    done(desk, "jog_step", axis=axis, frame="joint", distance=1.0 * sign)
    assert len(engine.jogged) == 2, "where its zero is not known there is no limit"


@pytest.mark.parametrize(
    ("verb", "args"),
    [
        ("mdi", {"text": "G0 Z1"}),
        ("probe", {"cycle": "bore", "values": {}, "offset": "none"}),
        ("retract", {"mm": 1.0}),
        ("jog", {"frame": "joint", "axis": "X", "speed": 1.0}),
        ("jog_step", {"frame": "joint", "axis": "X", "distance": 1.0}),
        ("home", {}),
    ],
)
def test_nothing_moves_a_tool_that_stands_in_a_thread_but_its_way_out(
    desk: CommandHandlers, service: Service, verb: str, args: dict[str, Any]
) -> None:
    service.thread.found = InThread(4.0, 1.25, 7, "part.ngc")
    with pytest.raises(CommandRefused, match=r"5\.00 mm deep.*line 7"):
        done(desk, verb, **args)
    assert "IN_THREAD" in {one["name"] for one in done(desk, "status")["notices"]}


def test_a_tool_that_was_turned_out_by_hand_is_said_to_be_out(
    desk: CommandHandlers, service: Service
) -> None:
    service.thread.found = InThread(4.0, 1.25, 7, "part.ngc")
    done(desk, "withdraw", is_out=True)
    assert service.thread.found is None
    with pytest.raises(CommandRefused, match="no thread"):
        done(desk, "withdraw")


def test_adaptive_feed_is_switched_where_the_machine_file_has_a_law_for_it(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    with pytest.raises(CommandRefused, match=r"write adaptive in \[spindle\]") as why:
        done(desk, "adaptive_feed", on=True)
    assert why.value.code == "bad"
    spindle = Spindle(9000.0, "drive", node=9, adaptive=AdaptiveFeed())
    service.set_up.take(Fitted(replace(service.set_up.machine, spindle=spindle), {}))
    assert done(desk, "adaptive_feed", on=True)["on"] is True
    assert engine.requests == [Request.ADAPTIVE_FEED]


@pytest.mark.parametrize(
    ("how", "told"),
    [
        ("stop", "part.ngc was stopped in line 2."),
        ("refused", "part.ngc ended early in line 2. G38.2: the probe has come to the end of its way"),
        ("fault", "part.ngc ended early in line 2. Emergency stop was requested."),
        ("end", None),
    ],
)
def test_a_run_that_ended_early_is_told_until_somebody_has_seen_it_or_another_begins(
    desk: CommandHandlers, service: Service, engine: FakeEngine, how: str, told: str | None
) -> None:
    loaded(desk, service)
    done(desk, "start")
    engine.now = engine.now._replace(line=2, motion_id=1)
    service.watch.look()
    assert done(desk, "status")["ended_early"] is None
    if how == "end":
        ended(service, engine)
    elif how == "fault":
        engine.now = engine.now._replace(mode=Mode.FAULT, fault=Fault.EMERGENCY_STOP, fault_axis=-1)
    else:
        if how == "refused":
            heard(service, refusal=message("probe.not_touched", code="G38.2"))
        service.watch.look()
        done(desk, "stop")
    service.watch.look()
    service.watch.look()
    now = done(desk, "status")
    if told is None:
        assert now["ended_early"] is None and now["job"]["state"] == now["run"]["result"] == "completed"
        return
    assert now["run"]["result"] == now["job"]["state"] and now["run"]["line"] == 2
    assert messages.text(now["run"]).startswith(told)
    assert messages.text(now["ended_early"]).startswith(told), now["ended_early"]
    service.writer.submit(lambda: None).result(HANGS_S)
    with history.reading(service.state) as past:
        (run,) = (one.facts for one in past.runs())
    kept = messages.text(messages.Message(key=run["key"], values=run["values"]))
    assert kept and (told.split(". ", 1)[-1][:20] in kept), "and the list of runs has it, too"
    done(desk, "seen")
    assert done(desk, "status")["ended_early"] is None
    assert done(desk, "status")["run"] == now["run"], "a script may ask later than the operator looks"
    assert run["record"] == now["run"]["id"]


def test_a_line_by_hand_that_ended_early_is_told_as_it_was_typed(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    done(desk, "mdi", text="G38.2 Z-5 F100")
    heard(service, refusal=message("probe.not_touched", code="G38.2"))
    service.watch.look()
    service.watch.look()
    assert messages.text(done(desk, "status")["ended_early"]).startswith("MDI G38.2 Z-5 F100 ended early")
    done(desk, "mdi", text="G0 X1")
    assert done(desk, "status")["ended_early"] is None, "another begins"


def test_a_run_that_is_stopped_on_the_way_to_its_place_was_stopped_there(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    loaded(desk, service, line=3)
    done(desk, "start")
    done(desk, "hold")
    done(desk, "stop")
    ended(service, engine)
    assert "in line 3" in messages.text(done(desk, "status")["ended_early"])


def test_what_was_gone_on_with_and_has_ended_is_loaded_again_before_the_next_part(
    desk: CommandHandlers, service: Service, engine: FakeEngine
) -> None:
    """Else the tool would begin in the middle of a part whose beginning nobody has cut."""
    interrupted(service)
    loaded(desk, service, restart=True)
    done(desk, "start")
    ended(service, engine)
    now = whole_status.status(service)
    assert (now["job"]["state"], now["can_start"], now["next"]["place"]) == ("completed", False, "programs")
    assert "load it again" in messages.text(now["next"])
    with pytest.raises(CommandRefused, match="load it again to run it from its beginning"):
        done(desk, "start")
    loaded(desk, service)
    done(desk, "start")
