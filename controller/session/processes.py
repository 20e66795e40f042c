"""What runs in the two processes of a live machine: the plan's and the tick's.

The plan's process owns SDO, the tick's the cyclic frames. They meet in the piece
socket and the snapshot alone, so either may be killed: without the plan the tick
stops on the path; without the tick the drives stop by their own supervision.
"""

from __future__ import annotations

import contextlib
import pickle
import signal
import socket
import sys
import time
from dataclasses import replace
from pathlib import Path

from controller import config, internal_error
from controller.handoff import PieceInbox, Recorder, RequestInbox, Snapshot, SnapshotBoard
from controller.machine import Machine, five
from controller.plan.planner import Planner
from controller.plan.text.program import ProgramError
from controller.session import checked, children, cores, cyclic
from controller.session.children import Job
from controller.session.plan_end import PLAN_TURN_S, PlanEnd
from controller.session.startup import SessionError
from controller.tick import loop
from controller.tick.cycle import Cycle
from drives import bus, commission, pdo

# A busy computer has been seen to hold a process back for 20 ms and more; beyond this the
# heartbeats judge. On a real bus two lost feedbacks in a row are a fault.
VIRTUAL_PATIENCE_S = 0.150
SAME_PLACE = 1e-9  # mm or rad

# Of ``loop.prepare`` and ``cores.take``, as an operator calls them.
PRIVILEGES = {
    "locked": "locked memory",
    "slack": "exact timers",
    "fifo": "real-time priority",
    "awake": "processors that are kept awake",
    "own core": "a core of its own",
}

EXPECTED = (ProgramError, SessionError, commission.CommissionError, bus.BusError)


def run(role: str, job_file: Path) -> int:
    """Runs ``tick`` or ``plan``; the exit code. Whatever ends it too early is one sentence beside the job."""
    job: Job = pickle.loads(job_file.read_bytes())
    try:
        (tick_main if role == "tick" else plan_main)(job)
    except EXPECTED as error:
        children.words_of(job_file).write_text(str(error))
    except Exception as error:  # the top of a process: its parent tells the operator
        children.words_of(job_file).write_text(own_error(role, error))
    else:
        return 0
    return 1


def own_error(role: str, error: Exception) -> str:
    """A mistake of ours in one sentence, with its place."""
    return f"The {role} process met an error of its own; report this: {internal_error.told(error)}"


# --- tick ------------------------------------------------------------------------


class Asked:
    """Becomes true when this process is asked to end."""

    def __init__(self) -> None:
        self.yes = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._hear)

    def _hear(self, _number: int, _frame: object) -> None:
        self.yes = True


def tick_main(job: Job) -> None:
    """The real-time process: opens the buses and ticks until SIGTERM. Raises BusError."""
    machine = job.machine
    ports = {settings.name: bus.open(settings, pdo.TICK_FILTERS) for settings in config.bus_settings(machine)}
    group = cyclic.group(machine, ports, _patience_s(machine))
    cycle = Cycle(
        machine,
        group,
        PieceInbox(children.joined(job.pieces, socket.SOCK_SEQPACKET)),
        RequestInbox(children.joined(job.requests, socket.SOCK_DGRAM)),
        SnapshotBoard(job.snapshot_path, create=False),
        Recorder(job.recorder_path, create=False),
        time.monotonic,
    )
    group.start()
    granted = loop.prepare()
    granted["own core"] = cores.take(granted["fifo"]) is not None
    if missing := lacking(granted, _simulated(machine)):
        with contextlib.suppress(OSError):  # nobody may be there to read it
            print(missing, file=sys.stderr, flush=True)
    asked = Asked()
    filenos = [port.fileno() for port in ports.values() if port.fileno() >= 0]
    turning = loop.Loop(cycle, loop.WallClock(), filenos)
    turning.run(lambda: not asked.yes)
    if turning.error is None:
        turning.stand_down()
    group.stop_sync()
    group.close()
    if turning.error is not None:
        raise turning.error


def lacking(granted: loop.Granted, simulated: bool) -> str:
    """What a tick has to do without, in a sentence for the journal; "" where a simulated one bears it."""
    missing = [PRIVILEGES[name] for name, given in granted.items() if not given]
    if simulated or not missing:
        return ""
    return (
        f"The tick runs without {', '.join(missing)}, so it may be late more often: "
        "'directrix service self-test' says what to do."
    )


def _patience_s(machine: Machine) -> float:
    """Simulated drives on a virtual bus are a process of this computer and may be late."""
    return VIRTUAL_PATIENCE_S if _simulated(machine) else 0.0


def _simulated(machine: Machine) -> bool:
    return all(bus.interface == "virtual" for bus in machine.buses)


# --- plan ------------------------------------------------------------------------


def plan_main(job: Job) -> None:
    """The plan's process: brings the machine up, then keeps the queue full until SIGTERM.

    A program that cannot be run is refused before anything moves. Raises what ``EXPECTED`` lists.
    """
    cores.leave()
    plan = PlanEnd(job.machine, job.pieces, job.requests, job.snapshot_path)
    task = checked.task(job.program, job.name, job.machine)
    walk = checked.walk_of(task, job.check, job.unchecked)
    for sentence in plan.start_up.commission():
        print(sentence, file=sys.stderr, flush=True)
    plan.start_up.come_up()
    now = plan.snapshot()
    if max(abs(a - b) for a, b in zip(now.joints, task.start, strict=True)) > SAME_PLACE:
        task = replace(task, start=five(now.joints))
        walk = checked.walk_of(task, job.check, job.unchecked)
    plan.load(walk.items, now)
    while not plan.alone:
        now = plan.snapshot()
        plan.planner.work(now)
        plan.flush()
        if plan.planner.error is not None and _stands_before_it(now, plan.planner):
            raise plan.planner.error
        time.sleep(PLAN_TURN_S)


def _stands_before_it(now: Snapshot, planner: Planner) -> bool:
    """Whether a program that is refused on the way has been run up to there."""
    return planner.finished and now.at_rest and now.plan_time_s >= now.queue_end_s
