"""A job as the status shows it: plain values, by what is known of it and a snapshot."""

from __future__ import annotations

from typing import Any

from controller.ipc.handoff import Snapshot
from controller.messages import Key, Message, facts, message
from controller.program import linked
from controller.service.jobs import INTERRUPTED, MDI, Job, settles_s
from controller.service.journal import Entry
from controller.service.time_left import Left

MAX_TYPED = 1000  # bytes of a line typed by hand that are shown


def to_dict(job: Job, now: Snapshot) -> dict[str, Any]:
    """What it is, how far it has come and what is left of it."""
    state, left, program = job.state_at(now), _left(job, now), job.program
    if job.last is not None and (now.line == 0 or not job.active):
        now = job.last  # an emergency stop has taken all away, or it has ended: the last place stays
    shown, messages = job.active or job.last is not None, job.announced.messages
    return {
        "name": program.name,
        "sha256": job.sha256,
        "text": typed_text(job),
        "state": state,
        "line": now.line if shown else program.spot.line if program.spot else None,
        "restart": job.restart,
        "dry_run_mm": program.dry_run_mm or None,
        "block_delete": job.block_delete,
        "block": now.motion_id if shown and now.motion_id >= 0 else None,
        "fraction": _share(job),
        "blocks": job.blocks,
        "duration_s": job.duration_s,
        "elapsed_s": job.elapsed_s(now) if shown and job.taken else None,
        **left._asdict(),
        "checking": job.news.checking,
        "message": messages[-1] if messages else None,
        "messages": messages,
        "notes": job.notes,
        "verdict": job.verdict,
        **facts(job.said),
    }


def interrupted(entry: Entry) -> dict[str, Any]:
    """As ``to_dict``, of what a service before this one ran and did not end: where it was."""
    job, spot = entry.job, entry.spot
    return {
        **dict.fromkeys(("text", "blocks", "checking", "message", "verdict", "starts")),
        **{"messages": [], "notes": [], "restart": []},
        "name": job.name,
        "sha256": job.file_sha256,
        "state": INTERRUPTED,
        "line": spot.line,
        "dry_run_mm": job.dry_run_mm or None,
        "block_delete": job.block_delete,
        "block": spot.motion_id if spot.motion_id >= 0 else None,
        "fraction": entry.done,
        "duration_s": entry.duration_s,
        "elapsed_s": entry.elapsed_s,
        **Left(entry.left_s)._asdict(),
        **message("interrupted", program=job.name, line=spot.line),
    }


def ended_early(job: Job, result: str, why: Message | None) -> Message | None:
    """What a run that did not come to its end leaves to be read; None of one that did."""
    if result == "completed":
        return None
    typed = (typed_text(job) or "").strip().split("\n")[0]
    program = Key("ended.cycle") if job.is_own else f"{MDI} {typed}" if typed else job.program.name
    spot = job.program.spot  # where it goes on, or begins, as long as it is on the way there
    line = job.last.line if job.last is not None and job.last.line else spot.line if spot is not None else 1
    if why is None:
        return message("ended.stopped", program=program, line=line)
    return message("ended.why", program=program, line=line, why=why)


def typed_text(job: Job) -> str | None:
    """A line typed by hand is in no store, and shown here."""
    if not job.is_mdi:
        return None
    return bytes(linked.parts(job.program.text)[0][:MAX_TYPED]).decode(errors="replace")


def _left(job: Job, now: Snapshot) -> Left:
    if job.state in ("loading", "completed"):
        return Left()
    if job.state in ("loaded", "starting"):
        return job.time.before_start(job.before_s, now.override, settles_s(job, now))
    if not job.active:
        return job.time.after_end(job.nominal_s)
    ends_s = now.queue_end_s if job.news.finished else None
    return job.time.running(now, job.nominal_s, ends_s, job.news.aside or job.news.returning)


def _share(job: Job) -> float | None:
    """Of a whole run that is done."""
    if not job.duration_s or job.state == "loading":
        return None
    done_s = job.before_s if job.state == "loaded" else job.nominal_s
    return 1.0 if job.state == "completed" else min(1.0, done_s / job.duration_s)
