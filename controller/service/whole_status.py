"""The status of the service: what the tick's snapshot holds, with the job, the changer and the drives."""

from __future__ import annotations

import contextlib
import os
import threading

from controller import messages, sealed_file
from controller.ipc.control_socket import LAST, Values, as_json
from controller.ipc.handoff import Snapshot, blank
from controller.machine.model import OFFSETS
from controller.messages import Message, message
from controller.service import alarms, job_status, restart_preview
from controller.service import status as machine_status
from controller.service.jobs import Job
from controller.service.journal import Entry
from controller.service.next_step import can_start, next_step
from controller.service.service import Service
from controller.state.modes import TOOL_CHANGE, Fault, Mode, Recovery

KEEP_S = 0.5  # so old is what is kept, at most
OF_A_TICK = ("time_s", "tick", "joints", "drives")  # other in each, also where nothing moves


def status(service: Service) -> Values:
    """As the verb of that name answers."""
    told = {**_status(service), "restart": restart_preview.restart(service)}
    step = next_step(told)
    return {**told, "next": step.to_json(), "can_start": can_start(told, step)}


def _status(service: Service) -> Values:
    alive, found = service.engine.tick_alive, service.engine.snapshot()
    sequence = service.sequencer.now
    kept = {
        "fault": fault_at(service, found, alive),
        "sequence": sequence.to_dict() if sequence is not None else None,
        "tick_alive": alive,
        "plan_alive": service.engine.plan_alive,
        "commissioned": service.processes.commissioned,
    }
    if found is None or found.tick < 0:
        return {
            **machine_status.not_begun(_snapshot_values(service, blank(len(service.set_up.machine.axes)))),
            **kept,
        }
    if not alive:
        return {**machine_status.unseen(_snapshot_values(service, machine_status.ended(found))), **kept}
    if service.processes.stands(found):
        return {
            **machine_status.unseen(_snapshot_values(service, machine_status.ended(found)), over=False),
            **kept,
        }
    return {**_snapshot_values(service, found), **kept}


def fault_at(service: Service, now: Snapshot | None, alive: bool = True) -> Values | None:
    """The fault as it is shown; ``alive``: the tick is."""
    if now is None or now.tick < 0:
        return service.troubles.shown
    if alive and service.processes.stands(now):
        return _of_hung(service.processes.pulse.age_s(now.tick))
    return service.troubles.at(now, alive)


def _of_hung(seconds: float) -> Values:
    """As ``alarms.of`` has a fault."""
    return {
        "name": "TICK_STANDS",
        "axis": None,
        **message("tick_stands", seconds=seconds),
        "cause": message("cause.TICK_STANDS"),
        "remedy": message("remedy.TICK_STANDS"),
        "recovery": Recovery.RESTART.name.lower(),
        "position_trusted": False,
        "recording": None,
    }


def facts(service: Service) -> Values:
    """What does not change while the service runs, and what is fitted."""
    return {
        **machine_status.facts(service.engine.machine, service.set_up.to_json()),
        "state": str(service.state),
        "pids": service.engine.pids,
        "records": service.room.facts(),
    }


class Kept:
    """What holds of the machine if nobody hears of this service again, in a file for who asks then.

    Positions and the place in the program are the last; that they are old, its time says. Written by a thread
    of its own where anything has changed: it may wait for the disk.
    """

    def __init__(self, service: Service) -> None:
        self._service, self._file = service, service.state / LAST
        self._told: Values = {}
        self._as_it_was: object = None
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="last told", daemon=True)

    def begin(self) -> Kept:
        """Look on."""
        self._thread.start()
        return self

    def close(self) -> None:
        """After an orderly end the drives are off, and that is no fault."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()
        if not self._told:
            return
        last, job = self._told["status"], self._service.run.loaded
        ended = {**last, "mode": Mode.OFF.name, "fault": None}
        if last["job"] and job is not None:
            ended["job"] = {**last["job"], "state": job.state, **messages.facts(job.said)}
        if (run := self._service.run.last) is not None:
            ended["run"] = run.to_json()
        self._write({**self._told, "status": ended})

    def _run(self) -> None:
        while not self._over.wait(KEEP_S):
            found = self._service.engine.snapshot()
            if found is not None and found.tick >= 0:
                self.look(found)

    def look(self, found: Snapshot) -> None:
        """Keep ``found``, as of a controller that is gone."""
        service = self._service
        gone = {**alarms.of(service.set_up.machine, Fault.CONTROLLER_GONE, -1), **message("service_gone")}
        status = {
            **machine_status.unseen(_snapshot_values(service, machine_status.ended(found))),
            **{"fault": {**gone, "recording": None}, "interlock": None, "warning": None, "notices": []},
            **{"sequence": None, "tick_alive": False, "plan_alive": False, "commissioned": None},
            **{"restart": restart_preview.restart(service), "next": None, "can_start": False},
        }
        changes = {key: value for key, value in status.items() if key not in OF_A_TICK}
        as_it_is = (found.joints, changes, service.set_up.fitted)
        if as_it_is != self._as_it_was:
            self._told = {"status": status, "facts": {**facts(service), "pids": {}}}
            self._as_it_was = as_it_is if self._write(self._told) else None
        with contextlib.suppress(OSError):
            os.utime(self._file)

    def _write(self, told: Values) -> bool:
        """Whether the disk took it."""
        with contextlib.suppress(OSError):
            sealed_file.write(self._file, as_json(told))
            return True
        return False


def retract_room_mm(service: Service, now: Snapshot) -> float | None:
    """As ``status.retract_room_mm``; None while the tool is on its way back, or a run is just ending."""
    if service.run.returning or (now.mode is Mode.READY and service.run.job is not None):
        return None
    return machine_status.retract_room_mm(service.set_up.machine, now)


def _snapshot_values(service: Service, now: Snapshot) -> Values:
    """The values of a snapshot, with the job and the motion under way."""
    set_up, machine, run = service.set_up, service.set_up.machine, service.run
    job = run.job or run.loaded
    entry = run.interrupted if job is None else None
    way = job.motions.under_way(now.motion_id) if job is not None and job.active else None
    asked = job.awaited_tool(now, set_up.tool) if job is not None else None
    turn = job.announced.awaited_speed(now) if job is not None and job.active else None
    if asked is not None and turn:  # the tool first
        turn = None
    age_s = service.processes.pulse.age_s(now.tick)
    ends_s = service.watch.last_second.left_s
    state = run.in_force(now)
    values = machine_status.machine_values(machine, now, way, state, set_up.tool, age_s, ends_s)
    change = service.changer.change(now) if service.changer is not None else None
    told_job = job_status.interrupted(entry) if entry is not None else None
    if job is not None:
        told_job = {**job_status.to_dict(job, now), "starts": _starts(service, job, now)}
    if change is not None:
        values["mode"] = TOOL_CHANGE
        told_job = told_job and {**told_job, "state": "running"}
    return {
        "time_s": now.tick * machine.period_s,
        **_with_notices(service, values),
        "change": change,
        "ended_early": run.ended_early,
        "run": run.last.to_json() if run.last is not None else None,
        "aside": run.aside,
        "no_resume": _no_resume(service, now),
        "retract_room_mm": retract_room_mm(service, now),
        "tool": set_up.tool or None,
        **({"in_block": _last_block(job, entry)} if job is None or not job.active else {}),
        "tool_change": machine_status.tool_change(machine, asked, service.usage) if asked else None,
        "spindle_change": machine_status.spindle_change(turn) if turn is not None else None,
        "changer": service.changer.to_json() if service.changer is not None else None,
        "control": None,
        "job": told_job,
        "drives": service.processes.drives(machine, now),
        "jogging": now.mode is Mode.JOG,
    }


def _starts(service: Service, job: Job, now: Snapshot) -> Message | None:
    """What a start begins with: program, line, tool and work offset; None where there is none to begin."""
    if job.active or job.state in ("loading", "refused"):
        return None
    there = next((row["values"] for row in job.restart if row["key"] in ("at.tool", "at.sized_tool")), None)
    if there is None:
        begin = service.run.begins_with(job, now)
        offset = job.offset or OFFSETS[begin.modal.offset if begin is not None else 0]
        there = {"tool": service.set_up.tool, "offset": offset}
    line = job.program.spot.line if job.program.spot is not None else 1
    facts = {"program": job.program.name, "line": line, "tool": there["tool"], "offset": there["offset"]}
    return message("starts" if there["tool"] else "starts_empty", **facts)


def _no_resume(service: Service, now: Snapshot) -> Message | None:
    """Why a held program cannot go on from where the tool is, or with which."""
    if now.mode is not Mode.HOLD:
        return None
    why = service.run.no_resume or ("away" if now.away else "")
    return message(why) if why else None


def _with_notices(service: Service, values: Values) -> Values:
    """That the tool stands in a thread and no program turns it; that nobody knows where the changer's
    tools are; that a file was damaged, which nobody has confirmed; that the run, or the last, has no record.

    An alarm tells of the record, too: but where the disk is full, nobody can keep that either.
    """
    notices, found = values["notices"], service.thread.found
    if found is not None and service.run.job is None:
        facts = {"depth": found.depth_mm, "pitch": found.pitch_mm, "line": found.line}
        notices = [*notices, {"name": "IN_THREAD", **message("in_thread", **facts)}]
    changer = service.changer
    if changer is not None and (doubt := changer.doubt) is not None:
        notices = [*notices, {"name": "CHANGER_IN_DOUBT", **doubt}]
    if (alarm := service.alarms.unconfirmed(alarms.DAMAGE)) is not None:
        notices = [*notices, {"name": alarms.DAMAGE, "key": alarm["key"], "values": alarm["values"]}]
    if service.run.recorder.unrecorded is not None:
        notices = [*notices, {"name": "NOT_RECORDED", **service.run.recorder.unrecorded}]
    return {**values, "notices": notices}


def _last_block(job: Job | None, entry: Entry | None) -> Values | None:
    """Of a program that has ended, or that a service before this one ran: where in its block it was."""
    if job is None or job.last is None:
        return entry.in_block if entry is not None else None
    way = job.motions.ways.get(job.last.motion_id)
    return way.in_block(job.last.s) if way is not None else None
