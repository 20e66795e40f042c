"""What to do next, in one sentence: a function of the status, and of nothing else.

One table of what can be in the way, from the worst to the least; the first row that holds is told, and what
it offers can be done as things are. What only waits, or must be put right by hand, offers nothing to press.

    {"key": "next.home", "values": {}, "verb": "home", "args": {}, "place": "", "waits": false}

``verb``, ``args``: as the door takes them; "" = nothing is to be pressed. ``place``: where the page shows
what is meant, or asks for what the verb needs: "programs", "changer", "alarms". ``waits``: it goes on by
itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from controller.messages import Key, Message, message
from controller.service import kept_file
from controller.service.jobs import INTERRUPTED, UNDER_WAY
from controller.state.modes import TOOL_CHANGE

Status = Mapping[str, Any]
ENDED_EARLY = ("stopped", "fault", INTERRUPTED)  # a job that may be gone on with


class Step(NamedTuple):
    """What is told, and what can be done about it."""

    said: Message
    verb: str = ""
    args: Mapping[str, Any] = MappingProxyType({})
    place: str = ""
    waits: bool = False

    def to_json(self) -> dict[str, Any]:
        rest = {"verb": self.verb, "args": dict(self.args), "place": self.place, "waits": self.waits}
        return {**self.said, **rest}


def next_step(status: Status) -> Step:
    """Of a whole status, as ``whole_status`` makes it."""
    return next(_steps(status))


def can_start(status: Status, step: Step) -> bool:
    """Whether a start of the loaded program is not refused; ``step``: the next one.

    What may be gone on with may be started from its beginning, too.
    """
    job = status["job"] or {}
    before = step.said["key"] in ("next.restart", "next.restart_tool") and job.get("state") in ENDED_EARLY
    return step.verb == "start" or (before and job["state"] != INTERRUPTED)


def _steps(status: Status) -> Iterator[Step]:
    """All that are to be done, the first one first."""
    sequence, mode = status["sequence"] or {}, status["mode"]
    if sequence.get("state") == "running":
        yield _wait("under_way", what=Key(f"sequence.{sequence['name'].replace(' ', '_')}"))
    if mode == "FAULT" and status["tick_alive"] and status["at_rest"] is False:
        yield _wait("coming_to_rest")
    if mode == "FAULT" or not status["tick_alive"]:
        yield from _out_of_fault(status)
    if status["at_rest"] is None:
        yield _wait("starting")
    if mode in ("HOMING", "JOG", "STOPPING"):
        yield _wait(mode.lower())
    if mode == TOOL_CHANGE:
        yield _wait("change", change=status["change"])
    if mode == "RUNNING":
        yield from _running(status)
    if mode == "HOLD":
        yield from _held(status)
    yield from _at_rest(status)


def _wait(key: str, **values: object) -> Step:
    return Step(message(f"next.{key}", **values), waits=True)


def _by_hand(key: str, place: str = "", **values: object) -> Step:
    return Step(message(f"next.{key}", **values), place=place)


def _press(key: str, verb: str, args: dict[str, Any] | None = None, **values: object) -> Step:
    return Step(message(f"next.{key}", **values), verb, args or {})


def _notice(status: Status, name: str) -> Message | None:
    found = next((one for one in status["notices"] or () if one["name"] == name), None)
    return Message(key=found["key"], values=found["values"]) if found is not None else None


def _fault_words(status: Status) -> Message:
    fault = status["fault"]
    remedy: Message | None = fault.get("remedy") if fault else None
    return remedy or message("no_tick")


def _barred(status: Status) -> Iterator[Step]:
    """An open door, an e-stop ... must be put right by hand."""
    if interlock := status["interlock"]:
        yield _by_hand("barred", fault=Key(f"fault.{interlock}"))


def _out_of_fault(status: Status) -> Iterator[Step]:
    yield _press("reset", "reset", remedy=_fault_words(status))


# ---- while a program is under way


def _running(status: Status) -> Iterator[Step]:
    """What keeps it from going on, if anything."""
    if status["feed_stopped"]:
        yield _by_hand("feed_stopped")
    if status["override"] == 0.0:
        yield _by_hand("no_feed")
    if status["waiting"]:
        spindle = status["spindle"] or {}
        yield _wait("waits_spindle" if spindle.get("at_speed") is False else "waits_others")
    for notice in status["notices"] or ():
        if notice["name"].startswith("QUEUE_") or notice["name"] == "PLAN_SILENT":
            yield _wait("notice", notice=Message(key=notice["key"], values=notice["values"]))
    yield _wait("running", program=(status["job"] or {}).get("name") or "")


def _held(status: Status) -> Iterator[Step]:
    job = status["job"] or {}
    if not status["at_rest"]:
        yield _wait("coming_to_rest")
    if not status["plan_alive"]:
        yield _wait("planner")
    yield from _barred(status)
    yield from _off_the_path(status)
    if change := status["tool_change"] or status["spindle_change"]:
        yield _press("notice", "resume", notice=Message(key=change["key"], values=change["values"]))
    if status["fault"]:
        yield _press("hold_fault", "resume", remedy=_fault_words(status))
    if (status["changer"] or {}).get("held"):
        yield _press("change_held", "resume")
    if job.get("message"):
        yield _press("message", "resume", message=job["message"])
    line = job.get("line") or 0
    if status["single_block"]:
        yield _press("single", "resume", line=line)
    yield _press("program_stop" if status["stands_at_stop"] else "held", "resume", line=line)


def _off_the_path(status: Status) -> Iterator[Step]:
    """Resume is refused as long as the tool is elsewhere, or another one."""
    why = status["no_resume"]
    if why is None:
        return
    failed = _failed(status, "return")
    if failed is not None:
        yield _press("no_return", "stop", why=failed)
    elif why["key"] == "away":
        yield _press("jogged_away", "stop")
    else:
        yield _press("return" if why["key"] == "aside" else "other_tools", "return")


def _failed(status: Status, name: str) -> Message | None:
    """Why the last piece of work of that name came to nothing, where nothing was done since."""
    sequence = status["sequence"] or {}
    failed = sequence.get("state") == "failed" and sequence.get("name") == name and sequence.get("key")
    return Message(key=sequence["key"], values=sequence["values"]) if failed else None


# ---- at rest


def _at_rest(status: Status) -> Iterator[Step]:
    """From cold to the first motion."""
    job = status["job"] or {}
    if job.get("state") in UNDER_WAY:
        yield _wait("ending" if job["state"] == "stopping" else "starting_program", program=job["name"])
    if not status["plan_alive"]:
        yield _wait("planner")
    if not status["commissioned"]:
        why = _failed(status, "power up") or _failed(status, "reset")
        yield _press("commission" if why is None else "not_commissioned", "reset", why=why or "–")
    if (doubt := _notice(status, "CHANGER_IN_DOUBT")) is not None:
        yield Step(message("next.changer", doubt=doubt), "changer_confirm", place="changer")
    yield from _barred(status)
    yield from _out_of_thread(status)
    if status["not_homed"]:
        yield _press("home", "home")
    if status["mode"] == "OFF":
        yield _press("enable", "enable")
    yield from _ready(status, job)


def _out_of_thread(status: Status) -> Iterator[Step]:
    """Nothing else moves a tool that stands in its thread; along it only where all is known of it."""
    thread = _notice(status, "IN_THREAD")
    if thread is None:
        return
    known = float(thread["values"].get("pitch") or 0.0) > 0.0
    if status["not_homed"] or not known or _failed(status, "withdraw") is not None:
        yield _press("turn_out", "withdraw", {"is_out": True})
    elif status["mode"] == "OFF":
        yield _press("enable", "enable")
    else:
        yield _press("withdraw", "withdraw")


def _ready(status: Status, job: Mapping[str, Any]) -> Iterator[Step]:
    """Which program, from where."""
    state, name = job.get("state"), job.get("name") or ""
    offer = status["restart"]
    if (damage := _notice(status, kept_file.ALARM)) is not None:
        yield _by_hand("damage", "alarms", what=damage)
    if state == "loading":
        yield _wait("loading", program=name)
    of_it = not job or (state in ENDED_EARLY and job["sha256"] == offer.get("sha256"))
    if of_it and (tool := offer.get("fetch")):
        other = Message(key=offer["key"], values=offer["values"])
        yield _press("restart_tool", "mdi", {"text": f"T{tool} M6"}, why=other)
    if of_it and offer["offered"]:
        yield Step(message("next.restart", offer=offer["says"]), "load", {"restart": True}, "restart")
    if not job or state == INTERRUPTED or job.get("text") is not None:
        yield _by_hand("choose", "programs")
    why = Message(key=job["key"], values=job["values"]) if job.get("key") else None
    if state == "refused" or (state == "loaded" and why is not None):
        yield _by_hand("refused", "programs", program=name, why=why or "–")
    if state == "completed" and why is not None:
        yield _by_hand("notice", "programs", notice=why)
    starts = job.get("starts")
    if starts and job.get("restart") and status["changer"] and starts["values"]["tool"] != status["tool"]:
        tool = starts["values"]["tool"]
        which = {"found": status["tool"] or 0, "wanted": tool, "program": name}
        other = message("offer.other_tool" if status["tool"] else "offer.no_tool", **which)
        yield _press("restart_tool", "mdi", {"text": f"T{tool} M6"}, why=other)
    key = "again" if state in ("completed", *ENDED_EARLY) else "start"
    yield _press(key, "start", program=name, what=starts or name)
