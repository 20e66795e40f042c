"""The client verbs that ask for more than one thing, over REST: ``directrix start``, ``override``, ``jog``;
and what those need that are made of the table of commands (``cli.commands``).

Each is one request or two to a panel, on this computer or another (``--url``), and prints one
line, or one JSON object with ``--json``. What moves the machine takes the control token and
gives it back; hold, stop and e-stop need none, so that nobody can be in their way.
"""

from __future__ import annotations

import contextlib
import secrets
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Annotated, Any

import typer

from controller.cli import remote, waiting
from controller.cli.remote import Machine
from controller.cli.speech import say
from controller.verify.console import Refused, agreed, answered, refusals, show, tell

Url = Annotated[str, typer.Option("--url", envvar="DIRECTRIX_URL")]
TakeOver = Annotated[bool, typer.Option("--take-over")]
Json = Annotated[bool, typer.Option("--json")]
Wait = Annotated[bool, typer.Option("--wait")]

REFRESH_S = 0.08  # of a jog: it comes to rest 200 ms after the last one
POLL_S = 0.2  # between two looks at what takes long
LONGEST_JOG_S = 600.0


@contextlib.contextmanager
def connected(url: str, as_json: bool) -> Iterator[Machine]:
    """The machine behind ``url``; what it refuses becomes one sentence and exit code 1."""
    with refusals(as_json), remote.connected(url, remote.known_token()) as machine:
        yield machine


def carried_out(machine: Machine, path: str, values: Mapping[str, Any] | None = None) -> Any:
    """POST what may take long, and wait for its end: after some seconds the answer is "not done yet".

    Raises Refused with the machine's sentence where it failed on the way.
    """
    answer = machine.post(path, values)
    while (answer.get("result") or {}).get("done") is False:
        time.sleep(POLL_S)
        sequence = machine.get("status").get("sequence") or {}
        if sequence.get("state") == "failed":
            raise Refused(str(sequence.get("sentence") or say("failed", path=path)))
        if sequence.get("state") != "running":
            answer["result"] = {**answer["result"], "done": True}
    return answer


def tell_done(sentence: str, facts: Any, as_json: bool) -> None:
    """One line, or what was answered."""
    if not answered(as_json, **(facts if isinstance(facts, dict) else {"result": facts})):
        show.print(sentence)


def set_going(
    machine: Machine,
    control: AbstractContextManager[Any],
    ask: Callable[[], Any],
    sentence: Callable[[Any], str],
    wait: bool,
    as_json: bool,
) -> None:
    """Ask for a run under ``control``, and print that it goes; where it is waited for, what came of it.

    ``sentence``: of the answer. Raises Refused, RunEnded.
    """
    with control:
        answer = ask()
        run = waiting.run_of(machine, answer) if wait else ""
    if wait:
        waiting.to_its_end(machine, run, as_json)
    else:
        tell_done(sentence(answer), answer, as_json)


def named(typed: Sequence[str] | None, words: Collection[str] = ()) -> dict[str, str | float]:
    """Values by name of what is typed as ``name=value``: numbers where they are, but never of ``words``.

    Raises Refused.
    """
    return dict(_pair(one, words) for one in typed or ())


def _pair(typed: str, words: Collection[str]) -> tuple[str, str | float]:
    name, equals, value = typed.partition("=")
    if not (name and equals):
        raise Refused(say("no_pair", typed=typed))
    with contextlib.suppress(ValueError):
        return name, value if name in words else float(value)
    return name, value


# --- cycle


def start(
    program: Annotated[str, typer.Argument()] = "",
    line: int | None = None,
    fraction: float | None = None,
    dry_run: float | None = None,
    block_delete: bool = False,
    restart: bool = False,
    unrecorded: bool = False,
    worn: bool = False,
    yes: bool = False,
    wait: bool = False,
    take_over: bool = False,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """Load a program and start it: from its beginning, at a line, or where it was interrupted."""
    with connected(url, as_json) as machine:
        place: dict[str, Any] = {"line": line, "fraction": fraction, "dry_run_mm": dry_run}
        if not (program or restart) and any(value is not None for value in place.values()):
            raise Refused(say("need_name"))
        if as_json and not yes and (restart or line is not None):
            raise Refused(say("need_yes"))

        def ask() -> Any:
            nonlocal program, line
            if restart:
                offer = _interrupted(machine, program)
                program, line, place["restart"] = offer["program"], offer["line"], True
            if block_delete:
                place["block_delete"] = True
            if program:
                loaded = load_program(machine, {"program": program, **place})
                if line is not None and not yes:
                    _agreed(loaded, line)
            confirmed = {"unrecorded": unrecorded, "worn": worn}
            return carried_out(machine, "cycle/start", confirmed if any(confirmed.values()) else None)

        def sentence(_: Any) -> str:
            return say("started_program", program=program) if program else say("started")

        set_going(machine, machine.control(take_over), ask, sentence, wait, as_json)


def load_program(machine: Machine, values: Mapping[str, Any]) -> Any:
    """Load, however long it takes. Raises Refused where it was refused, or another one is loaded by then."""
    answer = machine.post("job", values)
    while (answer.get("result") or {}).get("done") is False:
        time.sleep(POLL_S)
        job = machine.get("job")
        if job["name"] != values["program"] or job["state"] not in ("loading", "loaded"):
            raise Refused(str(job["sentence"] or say("other_loaded", program=values["program"])))
        if job["state"] == "loaded":
            answer["result"] = job
    return answer


def _interrupted(machine: Machine, program: str) -> dict[str, Any]:
    """What is offered. Raises Refused where it is nothing, or another program."""
    offer: dict[str, Any] = machine.get("restart")
    if not offer["offered"]:
        raise Refused(str(offer["sentence"]), line=offer.get("line"))
    if program and program != offer["program"]:
        raise Refused(say("other_interrupted", program=offer["program"], other=program))
    return offer


def _agreed(loaded: Any, line: int) -> None:
    """A start in mid program shows the state that it begins with, and asks."""
    for one in (loaded.get("result") or {}).get("restart") or ():
        tell.print(one["sentence"])
    if not agreed(say("agree", line=line)):
        raise Refused(say("not_agreed"))


def override(
    percent: float,
    rapid: bool = False,
    spindle: bool = False,
    take_over: bool = False,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """Scale the feed, the speed of rapids, or that of the spindle."""
    if rapid and spindle:
        raise typer.BadParameter(say("one_override"))
    path = "rapid" if rapid else "spindle" if spindle else "feed"
    with connected(url, as_json) as machine, machine.control(take_over):
        done = machine.put(f"overrides/{path}", {"share": percent / 100.0})
        tell_done(say(f"{path}_override", percent=percent), done, as_json)


# --- jog


def jog(
    axis: str,
    distance: Annotated[float | None, typer.Argument()] = None,
    speed: float | None = None,
    seconds: float | None = None,
    frame: str = "joint",
    take_over: bool = False,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """Move an axis by a distance, or at a speed for so many seconds; it comes to rest at its limit."""
    with connected(url, as_json) as machine:
        _one_of(distance, speed, seconds)
        where = {"frame": frame, "axis": axis.upper()}
        with machine.control(take_over):
            at_first = _at_limits(machine.get("status"))
            done: dict[str, Any] = {"seconds": seconds}
            if distance is not None:
                done = machine.post("jog/step", {**where, "distance": distance})
                moved = say("moved_by", axis=axis.upper(), distance=distance)
                now = _until_rest(machine, (done.get("result") or {}).get("tick", 0))
            else:
                _pressed(machine, {**where, "speed": speed}, seconds or 0.0)
                moved = say("moved_for", axis=axis.upper(), seconds=seconds)
                now = machine.get("status")
            if ends := [name for name in _at_limits(now) if name not in at_first]:
                moved = say("moved_to_limit", axis=axis.upper(), axes=", ".join(ends))
                done |= {"at_limit": ends}
            tell_done(moved, done, as_json)


def _at_limits(status: Mapping[str, Any]) -> list[str]:
    """Names of the axes that are at the end of their travel."""
    return [name for name, row in (status.get("joints") or {}).items() if row["limit"]]


def _one_of(distance: float | None, speed: float | None, seconds: float | None) -> None:
    both = (distance is None) == (speed is None) or (speed is None) != (seconds is None)
    if both:
        raise Refused(say("jog_usage"))
    if seconds is not None and not 0.0 < seconds <= LONGEST_JOG_S:
        raise Refused(say("jog_seconds", seconds=seconds, most=LONGEST_JOG_S))


def _until_rest(machine: Machine, tick: int) -> dict[str, Any]:
    """The status at rest. Whoever gives control back ends his jog, so wait.

    ``tick``: in which the jog was taken, older is no news.
    """
    try:
        while True:
            now: dict[str, Any] = machine.get("status")
            if not now.get("jogging") and ((now.get("tick") or {}).get("number") or 0) >= tick:
                return now
            time.sleep(REFRESH_S)
    except BaseException:
        machine.post("jog/stop", {})
        raise


def _pressed(machine: Machine, where: dict[str, Any], seconds: float) -> None:
    """As a finger on a key: refreshed while it is down, stopped by any end, also by Ctrl-C."""
    press = secrets.token_hex(8)
    until_s = time.monotonic() + seconds
    try:
        while time.monotonic() < until_s:
            machine.post("jog", {**where, "press": press})
            time.sleep(min(REFRESH_S, max(0.0, until_s - time.monotonic())))
    finally:
        machine.post("jog/stop", {"press": press})


def register(app: typer.Typer) -> None:
    """Adds these verbs to the command line; those that only ask for one thing are in ``cli.commands``."""
    for verb in (start, override):
        app.command(verb.__name__)(verb)
    # A distance such as -10 is no option.
    loose = {"ignore_unknown_options": True}
    app.command("jog", context_settings=loose)(jog)
