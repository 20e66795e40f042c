"""The report of a bring-up as one page of HTML, with pictures: what was done and found, and what to write."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from controller import atomic_file
from controller.bringup.protocol import BAD, REPORT, SKIPPED, Protocol
from controller.bringup.steps import Step
from controller.messages import Message, message
from controller.verify import html_page
from controller.verify.console import in_words, say, spoken

KEPT = ("verdict", "at_s", "figures", "findings", "proposals", "measured")  # of a step, in its row


def write(protocol: Protocol, steps: Sequence[Step]) -> None:
    """The report beside the protocol. Raises OSError."""
    atomic_file.write(protocol.folder / REPORT, page(protocol, steps))


def page(protocol: Protocol, steps: Sequence[Step]) -> str:
    """The whole document, in the language that is spoken."""
    return html_page.document(
        _say("title", machine=protocol.machine), spoken.get(), "".join(_parts(protocol, steps))
    )


def _parts(protocol: Protocol, steps: Sequence[Step]) -> Iterator[str]:
    yield f"<p>{escape(in_words(summary(protocol, steps)))}</p>\n"
    yield html_page.table(
        [_say("step"), _say("what"), _say("verdict"), _say("when")],
        [
            [step.name, in_words(step.text("title")), verdict(protocol, step), _when(protocol, step)]
            for step in steps
        ],
    )
    if rows := [row for step in steps for row in proposed(protocol, step)]:
        yield f"<h2>{escape(_say('proposed'))}</h2>\n"
        yield html_page.table([_say("axis"), _say("key"), _say("old"), _say("new"), _say("why")], rows)
    for step in steps:
        if step.name in protocol.done:
            yield from _step(protocol, step)


def summary(protocol: Protocol, steps: Sequence[Step]) -> Message:
    """How much of it is done."""
    done = [protocol.done[step.name]["verdict"] for step in steps if step.name in protocol.done]
    counts = {name: done.count(name) for name in (BAD, SKIPPED)}
    kind = message("bringup.simulated" if protocol.simulated else "bringup.real")
    return message("bringup.report.summed", done=len(done), all=len(steps), **counts, kind=kind)


def verdict(protocol: Protocol, step: Step) -> str:
    """Of a step: done well or not, or open."""
    row = protocol.done.get(step.name)
    word = _say("open" if row is None else str(row["verdict"]))
    return word if row is None or not protocol.is_of_another_file(step.name) else f"{word}, {_say('older')}"


def _when(protocol: Protocol, step: Step) -> str:
    row = protocol.done.get(step.name)
    return "" if row is None else time.strftime("%Y-%m-%d %H:%M", time.localtime(row["at_s"]))


def proposed(protocol: Protocol, step: Step) -> list[list[str]]:
    """Axis, key, the value in the machine file, the proposed one, and why."""
    row = protocol.done.get(step.name)
    if row is None or protocol.is_of_another_file(step.name):
        return []
    return [
        [one["axis"], one["key"], _value(one["old"]), _value(one["new"]), in_words(one["why"])]
        for one in row["proposals"]
    ]


def row(protocol: Protocol, step: Step, not_done: Message | None = None) -> dict[str, Any]:
    """A step as JSON: what it is, and what came of it; ``not_done``: why it was not ended just now."""
    done = protocol.done.get(step.name)
    found: dict[str, Any] = {"step": step.name, "moves": step.moves, "verdict": None}
    if done is not None:
        found |= {name: done[name] for name in KEPT}
    return found if not_done is None else {**found, "not_done": not_done}


def _value(value: float | bool) -> str:
    """As the machine file has it."""
    return str(value).lower() if isinstance(value, bool) else f"{value:.7g}"


def _step(protocol: Protocol, step: Step) -> Iterator[str]:
    row = protocol.done[step.name]
    yield f"<h2>{escape(in_words(step.text('title')))}</h2>\n<p>{escape(in_words(step.text('do')))}</p>\n"
    sentences = [*row["findings"], *row["figures"]]
    yield f"<ul>{''.join(f'<li>{escape(in_words(one))}</li>' for one in sentences)}</ul>\n"
    for one in row["charts"]:
        yield picture(one)


def picture(one: Mapping[str, Any]) -> str:
    """A chart of ``charts`` as SVG, its title above."""
    drawn = [html_page.Line(_name(line["name"]), line["x"], line["y"]) for line in one["series"]]
    title, words = in_words(one["title"]), (in_words(one["x"]), in_words(one["y"]))
    svg = (
        html_page.circle(title, words, drawn)
        if one["shape"] == "circle"
        else html_page.lines(title, words, drawn, log_x=one["shape"] == "log")
    )
    return f"<h3>{escape(title)}</h3>\n{svg}"


def _name(name: Any) -> str:
    return name if isinstance(name, str) else in_words(name)


def _say(key: str, **values: object) -> str:
    return say(f"bringup.report.{key}", **values)
