"""What the service concludes from what it sees, without any process."""

from __future__ import annotations

import contextlib
import sqlite3
from collections import deque
from pathlib import Path

import pytest
from support.fakes import fake_engine
from support.machines.stepped_runs import shipped

from controller import messages
from controller.ipc.control_socket import CommandRefused
from controller.ipc.handoff import Snapshot, blank
from controller.service import alarms, jobs, sequences, watch
from controller.service.command_handlers import CommandHandlers
from controller.service.folders import Folders
from controller.service.service import Service
from controller.state.modes import Fault, Mode


class _Ends:
    """As an engine does."""

    inverter = None

    def end_run(self) -> None: ...

    def tell_tool(self, number: int) -> None: ...

    def end(self) -> None: ...


class _Fault(_Ends):
    """An engine whose machine was in a fault when it was looked at, and is ready by now."""

    def __init__(self) -> None:
        self.machine, self.tick_alive, self.plan_alive, self.recorder = shipped(), True, True, None
        self.shown = _snapshot(tick=100, mode=Mode.FAULT, fault=Fault.EMERGENCY_STOP, at_rest=True)
        self.asked: deque[object] = deque()

    def snapshot(self) -> Snapshot:
        return self.shown


class _KilledTick(_Ends):
    """An engine whose tick has just been killed; the next one lives, and its bus cannot be heard."""

    def __init__(self) -> None:
        self.machine = shipped()
        self.tick_alive, self.plan_alive, self.recorder = False, True, None

    def snapshot(self) -> Snapshot:
        return _snapshot()

    def last_words(self) -> str:
        return "The tick process was killed by signal SIGKILL."

    def start(self) -> None:
        self.tick_alive = True


def _snapshot(**values: object) -> Snapshot:
    return blank()._replace(**values)  # type: ignore[arg-type]


def test_a_fault_that_took_long_to_tell_does_not_end_what_was_started_meanwhile(tmp_path: Path) -> None:
    engine = _Fault()
    service = Service(shipped(), Folders.within(tmp_path), engine)  # type: ignore[arg-type]
    job, tell = jobs.mdi("G0 X1", shipped()), service.troubles.look

    def slowly(now: Snapshot) -> None:
        tell(now)
        engine.shown = _snapshot(tick=400, mode=Mode.READY, at_rest=True)
        service.run.arm(job)

    service.troubles.look = slowly  # type: ignore[method-assign]
    service.watch.look()
    assert (service.run.job, job.state) == (job, "starting")


def test_what_a_tick_told_that_another_has_followed_is_nobodys_any_more(tmp_path: Path) -> None:
    """The look waits for the lock, and meanwhile the tick that it looks at is replaced."""
    engine = _Fault()
    service = Service(shipped(), Folders.within(tmp_path), engine)  # type: ignore[arg-type]

    class Late:
        def acquire(self, timeout: float) -> bool:
            engine.shown = _snapshot(mode=Mode.OFF, at_rest=True)
            return True

        def release(self) -> None: ...

        def __enter__(self) -> None: ...

        def __exit__(self, *_: object) -> None: ...

    service.run.lock = Late()  # type: ignore[assignment]
    service.watch.look()
    assert service.alarms.list() == []


def test_a_reset_before_anybody_saw_the_tick_die_loses_no_alarm(tmp_path: Path) -> None:
    service = Service(shipped(), Folders.within(tmp_path), _KilledTick())  # type: ignore[arg-type]
    with pytest.raises(CommandRefused, match="can0"):  # no bus is there
        sequences.start_engine(service)
    service.watch.look()
    (alarm,) = service.alarms.list()
    assert alarm["name"] == "CONTROLLER_GONE"
    assert "SIGKILL" in messages.text(alarm)


def test_how_long_what_is_loaded_would_take_is_known_anew_where_the_machine_has_moved_meanwhile(
    tmp_path: Path,
) -> None:
    """By hand, with another tool, at another override; a look at a machine that stands asks nothing."""
    service = fake_engine.served(tmp_path)
    desk, engine = CommandHandlers(service), fake_engine.engine_of(service)
    (service.state / "part.ngc").write_text("G1 X10 F600\nM30\n")
    fake_engine.done(desk, "load", path=str(service.state / "part.ngc"))

    def looks() -> int:
        """So often the plan was asked in two looks."""
        before = engine.orders.count("check")
        for _ in range(2):
            service.watch.look()
        service.sequencer.to_its_end("nothing", dict)  # after all that is to be done later
        return engine.orders.count("check") - before

    assert looks() == 0, "it is known from the load"
    x, *others = engine.now.joints
    engine.now = engine.now._replace(joints=(x + 5.0, *others))
    assert looks() == 1 and looks() == 0
    service.set_up.put_in(2)
    assert looks() == 1 and looks() == 0
    engine.now = engine.now._replace(override=0.5)
    assert looks() == 1 and looks() == 0
    engine.now = engine.now._replace(mode=Mode.JOG, joints=(x + 9.0, *others))
    assert looks() == 0, "not while it moves"


def test_what_is_damaged_in_the_store_while_it_serves_is_an_alarm_within_a_day(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = fake_engine.served(tmp_path)
    service.usage.set_item("oil", "motion", 10.0)
    service.usage.save(at_once=True)
    with contextlib.closing(sqlite3.connect(service.store.file)) as sql:  # which keeps no sums, as a bad bit
        changed = sql.execute("UPDATE documents SET value = '{}'").rowcount
        sql.commit()
    service.watch.look()
    service.writer.submit(int).result()
    assert service.alarms.list() == []
    monkeypatch.setattr(watch, "CHECK_S", 0.0)
    service.watch.look()
    service.writer.submit(int).result()
    (alarm,) = service.alarms.list()
    assert alarm["name"] == alarms.DAMAGE and alarm["values"]["what"] == f"documents {changed}"
    service.close()
