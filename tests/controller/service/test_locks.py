"""The rules of the service's threads and locks, as ``controller/service/__init__`` has them."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import HANGS_S, FakeEngine, engine_of, heard, served
from support.net.declared import ARGUMENTS

from controller.commands.table import COMMANDS
from controller.ipc.control_socket import CommandRefused
from controller.machine import machine_file
from controller.service.command_handlers import CommandHandlers
from controller.service.service import Service
from controller.state.modes import Mode

DOOR = "door"
AT_ONCE = ("status", "alarms", "hold", "resume", "jog", "jog_stop", "override", "spindle", "stop", "estop")


class Noted:
    """A lock that notes which thread took it, and which of the others that thread held then."""

    def __init__(self, name: str, own: Any, taken: list[tuple[str, str, tuple[str, ...]]]) -> None:
        self._name, self._own, self._taken = name, own, taken
        self.held: dict[str, int] = {}  # by thread
        self.others: tuple[Noted, ...] = ()

    def acquire(self, *args: Any, **more: Any) -> bool:
        thread = threading.current_thread().name
        before = tuple(one._name for one in self.others if one.held.get(thread))
        self._taken.append((thread, self._name, before if not self.held.get(thread) else ()))
        got = bool(self._own.acquire(*args, **more))
        if got:
            self.held[thread] = self.held.get(thread, 0) + 1
        return got

    def release(self) -> None:
        self.held[threading.current_thread().name] -= 1
        self._own.release()

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()


Taken = list[tuple[str, str, tuple[str, ...]]]


@pytest.fixture
def noted(tmp_path: Path) -> Iterator[tuple[CommandHandlers, Service, Taken]]:
    service = served(tmp_path, machine_file.load("machining_centre"))
    taken: Taken = []
    lock, fitting = Noted("lock", service.run.lock, taken), Noted("fitting", service.set_up.lock, taken)
    lock.others, fitting.others = (fitting,), (lock,)
    service.run.lock, service.set_up.lock = lock, fitting  # type: ignore[assignment]
    desk = CommandHandlers(service)
    yield desk, service, taken
    desk.close()
    service.close()


def at_the_door(desk: CommandHandlers, verb: str, args: dict[str, Any]) -> None:
    """As the socket's thread asks; then whatever it began comes to its end."""
    answers: list[Any] = []

    def ask() -> None:
        try:
            answers.append(desk(verb, args))
        except CommandRefused:
            answers.append(None)

    door = threading.Thread(target=ask, name=DOOR)
    door.start()
    door.join(HANGS_S)
    assert answers, f"{verb}: the door waits, or has failed"
    if isinstance(answers[0], Future):
        answers[0].exception(HANGS_S)


@pytest.mark.parametrize("mode", [Mode.READY, Mode.HOLD])
def test_what_must_not_wait_is_done_while_others_have_both_locks(
    mode: Mode, noted: tuple[CommandHandlers, Service, Taken]
) -> None:
    desk, service, _ = noted
    engine: FakeEngine = engine_of(service)
    with service.set_up.lock, service.run.lock:
        for verb in AT_ONCE:
            engine.now = engine.now._replace(mode=mode)
            for args in ARGUMENTS.get(verb, ({},)):
                at_the_door(desk, verb, args)


@pytest.mark.slow  # every command in four modes; some wait for a tick that is only made up
def test_the_door_takes_no_lock_and_fitting_comes_before_lock(
    noted: tuple[CommandHandlers, Service, Taken],
) -> None:
    desk, service, taken = noted
    engine: FakeEngine = engine_of(service)
    program = service.state / "part.ngc"
    program.write_text("G21 G90\nG4 P0.1\nM30\n")
    at_the_door(desk, "changer_confirm", {"clear": True, "spindle": 1, "away": []})
    for mode in (Mode.OFF, Mode.READY, Mode.HOLD, Mode.FAULT):
        at_the_door(desk, "load", {"path": str(program)})
        for verb in COMMANDS:
            engine.now = engine.now._replace(mode=mode)
            for args in ARGUMENTS.get(verb, ({},)):
                sent = {**args, "path": str(program)} if "path" in args else args
                at_the_door(desk, verb, sent)
            heard(service, finished=True, whole=True)
            service.watch.look()
    threads = {thread for thread, _, _ in taken}
    assert any("sequencer" in one for one in threads) and any("errands" in one for one in threads)
    assert DOOR not in threads, sorted({one for one in taken if one[0] == DOOR})
    assert not [one for one in taken if one[1] == "fitting" and "lock" in one[2]]


def test_the_locks_of_this_test_see_a_rule_that_is_broken(
    noted: tuple[CommandHandlers, Service, Taken],
) -> None:
    _, service, taken = noted
    with service.run.lock, service.set_up.lock:
        pass
    assert taken[-1][1:] == ("fitting", ("lock",))
