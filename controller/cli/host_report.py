"""A measurement of a computer as one page of HTML to be published: histogram, percentiles, and what it is.

It needs no other file, and names no computer, nobody and no folder of theirs.
"""

from __future__ import annotations

import math
import platform
import re
import time
from collections.abc import Iterator, Sequence
from html import escape

from controller.cli.host_lines import Line
from controller.cli.host_measure import SHARES, Measured, Turn
from controller.cli.host_view import Host
from controller.runtime.wake_ups import BINS, Histogram
from controller.verify import html_page
from controller.verify.console import say, spoken
from controller.verify.html_page import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, Scale, table
from controller.version import VERSION

PER_DECADE = 16  # classes of the histogram
BEYOND_US = 2 * BINS  # where the class of what is beyond ends

# Words of the kernel's command line that are facts of such a measurement; others may name disks and people.
WORDS = re.compile(
    r"^(isolcpus|nohz_full|rcu_nocbs|irqaffinity|nosmt|mitigations|idle|processor\.max_cstate"
    r"|intel_idle\.max_cstate|cpufreq\.default_governor|transparent_hugepage|preempt|tsc|clocksource|threadirqs"
    r"|skew_tick|nowatchdog|nmi_watchdog|intel_pstate|amd_pstate)(=|$)"
)


def page(measured: Measured, lines: Sequence[Line], host: Host) -> str:
    """The whole document, in the language that is spoken."""
    return html_page.document(_say("title"), spoken.get(), "".join(_parts(measured, lines, host)))


def _parts(measured: Measured, lines: Sequence[Line], host: Host) -> Iterator[str]:
    yield f"<p>{escape(verdict(measured))}</p>\n"
    yield f"<p>{escape(_how(measured))}</p>\n"
    rows = measured.rows()
    if rows:
        names = [name_of(kind, bus) for kind, bus, _ in rows]
        counts = [one for *_, one in rows]
        yield _histogram(names, counts, measured.limit_s)
        yield table(
            _heads(), [_figures(name, one, measured) for name, one in zip(names, counts, strict=True)]
        )
        yield f"<p>{escape(_say('meaning', limit=1e6 * measured.limit_s))}</p>\n"
    if len(measured.course) > 1:
        yield f"<h2>{escape(_say('course'))}</h2>\n{_course(measured.course, measured.limit_s)}"
    yield f"<h2>{escape(_say('computer'))}</h2>\n{table((), facts(host, measured))}"
    found = [(_say_host(one.verdict), one.shown, one.found, one.good) for one in lines]
    yield f"<h2>{escape(_say('check'))}</h2>\n{table(_words('verdict', 'what', 'found', 'good'), found)}"


def _histogram(names: Sequence[str], counts: Sequence[Histogram], limit_s: float) -> str:
    """How many woke how late; the limit is a line."""
    most = max(one.count for one in counts)
    x = Scale(1.0, BEYOND_US, LEFT, WIDTH - RIGHT, is_log=True)
    high = 10.0 ** max(math.ceil(math.log10(most + 1)), 1)
    y = Scale(math.sqrt(0.1), high, HEIGHT - BOTTOM, TOP, is_log=True)
    drawn = []
    for name, one in zip(names, counts, strict=True):
        classes = [(low, min(high, BEYOND_US), count) for low, high, count in one.classes(PER_DECADE)]
        ends = [(at, count) for low, high, count in classes for at in (low, high)]
        drawn.append(html_page.Line(name, [at for at, _ in ends], [count for _, count in ends]))
    limit = html_page.limit(x, 1e6 * limit_s, _say_picture("limit"))
    return html_page.on_scales(_say_picture("histogram"), (_say_picture("time"), ""), drawn, x, y, limit)


def _course(turns: Sequence[Turn], limit_s: float) -> str:
    """The worst of each turn over the time (min), with the limit as a line."""
    worst = [1e6 * one.worst_s for one in turns]
    high = math.ceil(math.log10(max(*worst, 1e6 * limit_s, 10.0)))
    x = Scale(0.0, turns[-1].ended_s / 60.0, LEFT, WIDTH - RIGHT)
    y = Scale(1.0, 10.0**high, HEIGHT - BOTTOM, TOP, is_log=True)
    drawn = [html_page.Line(_say_picture("worst"), [one.ended_s / 60.0 for one in turns], worst)]
    limit = html_page.limit(y, 1e6 * limit_s, _say_picture("limit"))
    return html_page.on_scales(_say_picture("course"), (_say_picture("minutes"), ""), drawn, x, y, limit)


def _say_picture(key: str) -> str:
    return say(f"host.picture.{key}")


def verdict(measured: Measured) -> str:
    """Whether it holds its period, in a sentence."""
    return _say("fit" if measured.is_fit else "unfit", period=1e3 * measured.period_s)


def _how(measured: Measured) -> str:
    told = [_say("measured_for", time=duration(measured.ran_s), kinds=_kinds(measured))]
    if measured.tick is not None:
        tick = measured.tick
        figures = {"ticks": tick["number"], "skips": tick["skips"], "worst": 1e3 * tick["late_max_ms"]}
        told.append(_say("of_tick", **figures))
    told.append(_say("faults", minor=measured.minor_faults, major=measured.major_faults))
    if measured.late.count:
        told.append(_say("real_time" if measured.real_time else "no_real_time"))
    if not measured.whole:
        told.append(_say("ended"))
    return " ".join(told)


def _kinds(measured: Measured) -> str:
    key = "beside_tick" if measured.from_tick else "in_turns" if len(measured.rows()) > 1 else "alone"
    return _say(key)


def duration(seconds: float) -> str:
    """Hours, minutes and seconds, as far as there are any."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    parts = ((hours, "h"), (minutes, "min"), (rest, "s"))
    return " ".join(f"{value} {unit}" for value, unit in parts if value) or f"{seconds:.2g} s"


def name_of(kind: str, bus: str) -> str:
    """Of what was counted."""
    return _say(f"kind.{kind}", bus=bus)


def _heads() -> list[str]:
    shares = [f"p{100.0 * share:g}" for share in SHARES]
    return [_say("counted"), _say("number"), *shares, _say("worst"), _say("too_late")]


def _figures(name: str, counts: Histogram, measured: Measured) -> list[str]:
    shares = [f"{1e6 * counts.quantile_s(share):.0f}" for share in SHARES]
    return [
        name,
        str(counts.count),
        *shares,
        f"{1e6 * counts.worst_s:.0f}",
        str(counts.over(measured.limit_s)),
    ]


# --- the computer ----------------------------------------------------------------------------


def facts(host: Host, measured: Measured) -> list[tuple[str, str]]:
    """What the figures are of."""
    marks = [host.text(f"sys/class/dmi/id/{name}") for name in ("sys_vendor", "product_name")]
    board = " ".join(filter(None, marks)) or host.text("proc/device-tree/model")
    words = [word for word in host.text("proc/cmdline").split() if WORDS.match(word)]
    versions = host.text("proc/sys/kernel/version") or host.text("proc/version").partition("#")[2]
    drivers = sorted({driver for one in host.can_interfaces() if (driver := host.driver(one))})
    system = re.search(r'^PRETTY_NAME="?([^"\n]*)', host.text("etc/os-release"), re.M)
    found = [
        ("processor", f"{host.processor or '–'}; {len(host.online)}"),
        ("board", board),
        ("system", system[1] if system else ""),
        ("kernel", f"{host.text('proc/sys/kernel/osrelease')} {versions}".strip()),
        ("command_line", " ".join(words)),
        ("can", ", ".join(drivers)),
        ("core", "" if measured.core is None else str(measured.core)),
        ("versions", f"Directrix {VERSION}, Python {platform.python_version()}"),
        ("cyclictest", measured.other_version),
        ("day", time.strftime("%Y-%m-%d", time.gmtime())),
    ]
    return [(_say(f"fact.{key}"), value) for key, value in found if value]


def _words(*keys: str) -> list[str]:
    return [_say(f"head.{key}") for key in keys]


def _say_host(key: str) -> str:
    return say(f"host.{key}")


def _say(key: str, **values: object) -> str:
    return say(f"host.report.{key}", **values)
