"""What was interrupted and could be gone on with: looked at only, nothing is loaded by it."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Any

from controller import messages
from controller.ipc.control_socket import CommandRefused
from controller.machine.model import Machine
from controller.messages import Message, message, several
from controller.plan.restart.program_position import AFTER_CHANGE, FORMER, Spot
from controller.service import jobs, journal
from controller.service.jobs import Job
from controller.service.refusals import refused
from controller.service.service import Service


def restart(service: Service) -> dict[str, Any]:
    """The journal's last entry as plain values; key and values say why it is not ``offered``.

    Whether the program is still there as it was is for who keeps the programs: it is told by the
    ``sha256`` of its file. A load with ``restart`` looks at everything again.
    """
    entry = service.journal.last
    if entry is None or entry.ended:
        return {"offered": False, **message("not_interrupted")}
    if (job := service.run.job) is not None and not job.is_mdi:
        return {"offered": False, **message("running", program=job.program.name)}
    why = _why_not(service, entry)
    return {
        "offered": why is None,
        **messages.facts(why),
        "name": entry.job.name,
        "sha256": entry.job.file_sha256,
        "says": several(_place(entry), _goes_on(entry)) if why is None else _place(entry),
        "line": entry.spot.line if entry.change is None else entry.change[2],
        "fraction": entry.spot.fraction if entry.change is None else 0.0,
        "change": entry.change is not None,
        "exact": entry.exact,
        "done": entry.done,
        "left_s": entry.left_s,
        "tool": entry.required_tool,
        "fetch": entry.required_tool if why is not None and why["key"] in OTHER_TOOL else None,
        "mode": entry.mode,
        "fault": None if entry.fault == "NONE" else entry.fault,
        "dry_run_mm": entry.job.dry_run_mm or None,
        "interrupted_s": entry.time_s,
    }


OTHER_TOOL = ("offer.other_tool", "offer.no_tool")


def _place(entry: journal.Entry) -> Message:
    """Where it was interrupted."""
    if entry.change is not None:
        out, into, line = entry.change
        return message("offer.change", program=entry.job.name, line=line, out=out, into=into)
    percent = f"{entry.spot.fraction * 100.0:.1f}"
    return message("offer.place", program=entry.job.name, line=entry.spot.line, percent=percent)


def _goes_on(entry: journal.Entry) -> Message:
    """What a restart does."""
    if entry.change is not None:
        return message("offer.goes_on_after", into=entry.required_tool)
    return message("offer.goes_on_at", tool=entry.required_tool)


def _why_not(service: Service, entry: journal.Entry) -> Message | None:
    """Why a load from there would be refused; None: it would not, as far as can be known before it."""
    why = service.journal.why_not(service.set_up.machine, *_trusted(service))
    return why or _not_with(service, entry)


def _not_with(service: Service, entry: journal.Entry) -> Message | None:
    """A changer's tools: nobody knows where they are, or another one is in the spindle."""
    if service.changer is None:
        return None  # by hand it is changed on the way in
    if (doubt := service.changer.doubt) is not None:
        return doubt
    found, wanted, program = service.set_up.tool, entry.required_tool, entry.job.name
    if found == wanted:
        return None
    return message(OTHER_TOOL[not found], found=found, wanted=wanted, program=program)


def _trusted(service: Service) -> tuple[int, int]:
    """Bit masks of the axes that are homed, and of those whose position a fault has cost."""
    now = service.engine.snapshot()
    if now is None or not service.engine.tick_alive or service.processes.stands(now):
        return 0, 0  # nobody knows where the axes are
    return now.homed, now.untrusted


def gone_on_with(service: Service, args: dict[str, Any]) -> Job:
    """The job of a ``load`` from where the journal says that it was interrupted. Raises CommandRefused."""
    entry, mode = service.journal.last, service.processes.now().mode.name
    if entry is None:
        raise refused("not_interrupted", mode, "LOAD")
    if why := _not_with(service, entry):
        raise CommandRefused("refused", why, mode, "LOAD")
    job = jobs.read({**args, "block_delete": entry.job.block_delete}, service.set_up.machine)
    job.go_on_with(entry)
    look_again(service, job, "LOAD")
    return job


def look_again(service: Service, job: Job, request: str = "START") -> None:
    """What was loaded to be gone on with, by what is fitted now. Raises CommandRefused where it forbids."""
    entry, program, now, set_up = job.entry, job.program, service.processes.now(), service.set_up
    assert entry is not None
    here = journal.Job.of(program.name, program.text, set_up.machine, entry.job.start, program.dry_run_mm)
    if why := journal.refusal(entry, here, now.homed, now.untrusted, len(set_up.machine.axes)):
        raise CommandRefused("refused", why, now.mode.name, request)
    # Its lines set anew what they had set, so it is begun with what was fitted then, but for other tools.
    fitted = set_up.fitted if entry.job.fitted is None else entry.job.fitted
    cut_with = None if entry.job.fitted is None else set_up.applied(fitted)
    if here.tools_sha256 != entry.job.tools_sha256:
        fitted = {**fitted, "tools": set_up.fitted.get("tools", {})}
    machine = set_up.applied(fitted)
    job.fit(replace(program, machine=machine, spot=_spot(entry, here, machine), cut_with=cut_with), fitted)


def tell_beside(service: Service) -> None:
    """After the tick was gone, the drives having kept count: how far off the path they stopped."""
    entry, job = service.journal.last, service.run.loaded
    if entry is None or entry.ended or job is None or job.state != "fault":
        return
    program = replace(job.program, spot=entry.spot, start=entry.job.start)
    with contextlib.suppress(CommandRefused):  # the program may be refused by now, and this is only shown
        if found := service.engine.line.order("beside", program=program)["said"]:
            service.alarms.add("BESIDE_THE_PATH", found, line=entry.spot.line)


def _spot(entry: journal.Entry, here: journal.Job, machine: Machine) -> Spot:
    """Where to go on; a changer makes other motions of a program that begins with another tool."""
    spot = journal.spot_of(entry, here)
    if machine.changer is None or spot.motion_id == AFTER_CHANGE:
        return spot
    return Spot(spot.line, spot.fraction, FORMER)
