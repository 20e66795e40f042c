"""``directrix serve``, once its options are read: from the first process to an orderly end."""

from __future__ import annotations

import errno
import fcntl
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from controller import own_files
from controller.ipc import control_socket
from controller.machine.model import Machine
from controller.messages import message
from controller.runtime import children
from controller.runtime.startup import SessionError
from controller.service import engine, pendant, sequences, whole_status
from controller.service.command_handlers import CommandHandlers
from controller.service.folders import Folders
from controller.service.requests import Requests
from controller.service.service import Service
from controller.service.socket_server import Server
from controller.service.watch import POLL_S
from controller.state.modes import Mode

Tell = Callable[[str], None]  # systemd's notify protocol

REST_LOOKS = 3.0  # periods of a look while nothing moves and nothing is recorded
FEED_S = 0.5  # between two signs of life; each needs a tick that has gone on
STATUS_S = 2.0


def run(
    machine: Machine,
    state: Path,
    runtime: Path,
    simulate: bool,
    tell: Tell,
    group: str = "",
    hand: pendant.Settings | None = None,
    part: Path | None = None,
) -> None:
    """Until SIGTERM or SIGINT; ``hand``: a handwheel or gamepad; ``part``: as ``opened``.

    Raises SessionError, ConfigError, BusError, OSError where it cannot begin.
    """
    if simulate:
        machine = engine.simulated(machine)
    elif any(bus.interface == "virtual" for bus in machine.buses):
        raise SessionError(message("startup.no_drives", name=machine.name))
    asked = children.EndRequest()
    control = control_socket.control_path(runtime)
    with (
        opened(machine, Folders.within(state), runtime, group, part) as service,
        pendant.following(hand, control),
    ):
        tell("READY=1")
        watch(service, lambda: asked.yes, tell)
        tell("STOPPING=1")


@contextmanager
def opened(
    machine: Machine,
    kept: Folders,
    runtime: Path,
    group: str = "",
    part: Path | None = None,
    stamped: bool = False,
) -> Iterator[Service]:
    """The service of a machine, powered up, with its door in ``runtime``; everything ends with the block.

    ``part``: what the probe of a simulated one can touch, a simulation file; None: the usual.
    ``stamped``: as the engine's hubs.

    Somebody has to ``watch`` it. Raises what ``run`` does.
    """
    with alone(kept.state), _opened(machine, kept, runtime, group, part, stamped) as service:
        yield service


@contextmanager
def alone(state: Path) -> Iterator[None]:
    """Holds a state folder: two services, each with sockets of its own, would write over each other.

    A killed one holds it no more (flock(2) of the folder, which no child inherits). Raises OSError.
    """
    own_files.make_folder(state, state)
    with own_files.folder(state) as at:
        try:
            fcntl.flock(at, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise own_files.refusal(errno.EEXIST, message("another_service"), state) from error
        yield


@contextmanager
def _opened(
    machine: Machine, kept: Folders, runtime: Path, group: str, part: Path | None, stamped: bool
) -> Iterator[Service]:
    service = Service(machine, kept)
    last = whole_status.Kept(service).begin()
    try:
        service.engine.start_hubs(part, stamped)
        handlers = CommandHandlers(service)
        requests = Requests(service.store)
        with_door = Server(control_socket.control_path(runtime), handlers, group, requests.noted)
        try:
            control_socket.note_runtime(kept.state, runtime)
            sequences.power_up(service)
            yield service
        finally:
            with_door.close()
            requests.close()
            handlers.close()
    finally:
        service.close()
        last.close()


def watch(
    service: Service, over: Callable[[], bool], tell: Tell = lambda _: None, look_s: float = POLL_S
) -> None:
    """Look on until it is ``over``; by one thread. ``look_s``: from one look to the next.

    The watchdog is fed by ticks, not by this loop: a tick that hangs starves it.

    A tick that is gone has done what a restart would bring: its drives stand, its alarm is told, and
    a reset starts another. Then there is nothing to watch, and a restart would cost that reset; the
    same holds until the first tick of the other.
    """
    fed_tick, fed_s, told, told_s = -1, 0.0, "", 0.0
    while not over():
        now, now_s = service.watch.look(), time.monotonic()
        lives = now is not None and now.tick != fed_tick
        due = now_s - fed_s >= FEED_S
        if due and (service.processes.starting or (now and (lives or not service.engine.tick_alive))):
            tell("WATCHDOG=1")
            fed_tick, fed_s = now.tick if now else -1, now_s
        if now_s - told_s >= STATUS_S and (words := _words(service)) != told:
            tell(f"STATUS={words}")
            told, told_s = words, now_s
        rests = service.run.job is None and now is not None and now.at_rest
        time.sleep(REST_LOOKS * look_s if rests else look_s)


def _words(service: Service) -> str:
    now, job = service.engine.snapshot(), service.run.job
    if now is None or not service.engine.tick_alive:
        return "the tick process is gone"
    shown = whole_status.fault_at(service, now)
    fault = f", {shown['name']}" if shown else ""
    mode = Mode.FAULT if service.processes.stands(now) else now.mode
    return f"{mode.name}{fault}" + (f", {job.program.name} line {now.line}" if job is not None else "")
