"""``--wait`` of the verbs that set a run going: until it has ended, with an exit code for each way to end.

A run is known by its id, so that another one that begins afterwards is never taken for it. Control is given
back before: while a script waits, an operator may hold, resume and stop as ever.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from controller.cli.remote import Machine
from controller.cli.speech import say
from controller.verify.console import Refused, answered, bar, show, tell

POLL_S = 0.2  # between two looks
SILENT_S = 15.0  # so long nobody may know of the run before its end is given up
MAX_RUNS = 200  # of the list, in which an ended one is looked for
COMPLETED = "completed"
UNKNOWN = "unknown"
# By the result of the run; 1 is what did not begin, and 0 alone is a run that came to its end.
EXIT_CODES = {
    "not_started": 1,
    "refused": 5,
    "stopped": 6,
    "fault": 7,
    "interrupted": 8,
    "lost": 8,
    UNKNOWN: 8,
}


class RunEnded(Refused):
    """A run did not come to its end; the exit code says in which way."""

    def __init__(self, sentence: str, run: Mapping[str, Any]) -> None:
        super().__init__(sentence, run=dict(run))
        self.exit_code = EXIT_CODES.get(str(run["result"]), EXIT_CODES[UNKNOWN])


def run_of(machine: Machine, answer: Mapping[str, Any]) -> str:
    """The id of the run that was just set going. Raises RunEnded where nobody knows of one."""
    found = (answer.get("result") or {}).get("run") or (machine.get("status").get("run") or {}).get("id")
    if not found:
        raise _unknown("")
    return str(found)


def to_its_end(machine: Machine, run: str, as_json: bool) -> None:
    """Wait, and print what came of it. Raises RunEnded unless it came to its end."""
    try:
        ended = _ended(machine, run, as_json)
    except KeyboardInterrupt:
        tell.print(say("goes_on"))
        raise
    if ended["result"] != COMPLETED:
        raise RunEnded(ended["sentence"] or say("ended_as", **ended), ended)
    if not answered(as_json, run=ended):
        show.print(say("completed", program=ended["program"]))


def _ended(machine: Machine, run: str, as_json: bool) -> dict[str, Any]:
    """Id, program, result, line and sentence. Raises RunEnded where its end cannot be found out."""
    asks, silent_s = "", 0.0
    with bar(say("waits_for_end"), as_json) as progress:
        while True:
            try:
                found, now = outcome_and_status(machine, run)
            except Refused as refused:
                if refused.facts.get("status") in (401, 403):
                    raise
                found, now = None, {}
            if found is not None and found["result"] is not None:
                return found
            silent_s = 0.0 if found is not None else silent_s + POLL_S
            if silent_s > SILENT_S:
                raise _unknown(run)
            progress(float((now.get("job") or {}).get("fraction") or 0.0), str(now.get("mode", "")))
            asks = asks if as_json else _ask(now, asks)
            time.sleep(POLL_S)


def outcome_and_status(machine: Machine, run: str) -> tuple[dict[str, Any] | None, Mapping[str, Any]]:
    """What is known of a run, and the status; None: nothing. Raises Refused."""
    try:
        now = machine.get("status")
    except Refused as refused:
        if refused.facts.get("code") != "gone":
            raise
        now = {}
    seen = now.get("run") or {}
    if seen.get("id") == run:
        return {key: seen.get(key) for key in ("id", "program", "result", "line", "sentence")}, now
    for one in machine.get("runs", most=MAX_RUNS)["runs"]:
        facts = one["facts"]
        if facts.get("record") == run:
            where = {"line": facts.get("line"), "sentence": facts.get("sentence")}
            return {"id": run, "program": one["program"], "result": one["result"], **where}, now
    return None, now


def _ask(now: Mapping[str, Any], before: str) -> str:
    """Where the run stands and an operator must do something, once what; what was said."""
    step = now.get("next") or {}
    if now.get("mode") != "HOLD" or step.get("waits") or not step.get("sentence"):
        return before if now.get("mode") == "HOLD" else ""
    if (sentence := str(step["sentence"])) != before:
        tell.print(sentence)
    return sentence


def _unknown(run: str) -> RunEnded:
    facts = {"id": run or None, "program": None, "result": UNKNOWN, "line": None, "sentence": None}
    return RunEnded(say("run_unknown"), facts)
