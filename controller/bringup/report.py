"""The report of a bring-up as one page of HTML, with pictures: what was done and found, and what to write."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from controller.bringup.protocol import GOOD, Protocol
from controller.bringup.steps import Step
from controller.messages import message
from controller.verify import chart, html_page
from controller.verify.console import in_words, say, spoken


def page(protocol: Protocol, steps: Sequence[Step]) -> str:
    """The whole document, in the language that is spoken."""
    return html_page.document(
        _say("title", machine=protocol.machine), spoken.get(), "".join(_parts(protocol, steps))
    )


def _parts(protocol: Protocol, steps: Sequence[Step]) -> Iterator[str]:
    yield f"<p>{escape(summed(protocol, steps))}</p>\n"
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


def summed(protocol: Protocol, steps: Sequence[Step]) -> str:
    """How much of it is done, in a sentence."""
    done = [step.name for step in steps if step.name in protocol.done]
    bad = sum(protocol.done[name]["verdict"] != GOOD for name in done)
    kind = in_words(message("bringup.simulated" if protocol.simulated else "bringup.real"))
    return _say("summed", done=len(done), all=len(steps), bad=bad, kind=kind)


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
    drawn = [chart.Line(_name(line["name"]), line["x"], line["y"]) for line in one["series"]]
    title, words = in_words(one["title"]), (in_words(one["x"]), in_words(one["y"]))
    svg = (
        chart.circle(title, words, drawn)
        if one["shape"] == "circle"
        else chart.lines(title, words, drawn, log_x=one["shape"] == "log")
    )
    return f"<h3>{escape(title)}</h3>\n{svg}"


def _name(name: Any) -> str:
    return name if isinstance(name, str) else in_words(name)


def _say(key: str, **values: object) -> str:
    return say(f"bringup.report.{key}", **values)
