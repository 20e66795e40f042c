"""A run as a page to be printed or kept: what the store knows of it, nothing counted anew.

html = page(Facts(run, check, alarms, files), "en")
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from html import escape
from typing import Any

from controller import messages
from controller.store.history import Alarm, Run

AS_CUT = "as_cut"  # of a run's facts, see ``run_verdicts``
OF_RUN = ("duration_s", "planned_s", "cut_time_s", "ticks", "skips", "line")
OF_CHECK = ("duration_s", "blocks")
SHARES = ("velocity_share", "acceleration_share", "jerk_share")
_STYLE = (
    "body{font:16px/1.4 sans-serif;margin:2rem auto;max-width:52rem;padding:0 1rem;color:#111;"
    "background:#fff}\n"
    "table{border-collapse:collapse;margin:.5rem 0 1.5rem}\n"
    "th,td{text-align:left;padding:.25rem 1rem .25rem 0;border-bottom:1px solid #bbb;vertical-align:top;"
    "overflow-wrap:anywhere}\ntd{font-variant-numeric:tabular-nums}"
)


@dataclass(frozen=True, slots=True)
class Facts:
    """What the store has of a run."""

    run: Run
    check: Mapping[str, Any]  # result of the check of what was run; {} = not kept
    alarms: Sequence[Alarm]  # while it ran
    files: Sequence[str]  # of its record


def page(told: Facts, language: str) -> str:
    """The whole document, which needs no other file."""
    word = {key.removeprefix("report."): text for key, text in messages.of(language).page.items()}
    run = told.run
    title = escape(word["title"].format(run.id, run.program))
    parts = "".join(_parts(told, word, language))
    return (
        f'<!doctype html><html lang="{language}"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{_STYLE}</style></head><body><h1>{title}</h1>{parts}</body></html>\n"
    )


def _parts(told: Facts, word: Mapping[str, str], language: str) -> Iterator[str]:
    run, why = told.run, messages.text(told.run.facts, language)
    rows = [
        (word["result"], run.result),
        (word["began"], _moment(run.began_s)),
        (word["ended"], _moment(run.ended_s)),
        *((word[key], _figure(run.facts[key])) for key in OF_RUN if run.facts.get(key) is not None),
        *([(word["sentence"], why)] if why else []),
        (word["sha256"], run.sha256),
    ]
    yield _table(rows)
    errors = run.facts.get("following_error") or {}
    yield f"<h2>{word['following_error']} ({word['unit']})</h2>"
    yield _table([(axis, _figure(value)) for axis, value in errors.items()]) or f"<p>{word['none']}</p>"
    yield from _contour(run.facts.get("contour_error") or {}, word)
    if told.check:
        yield from _check(told.check, word, language)
    if cut := run.facts.get(AS_CUT):
        yield from _as_cut(cut, word, language)
    yield f"<h2>{word['alarms']}</h2>"
    alarms = [
        (f"{_moment(one.at_s)} {one.name} {one.axis}", messages.text(asdict(one), language))
        for one in told.alarms
    ]
    yield _table(alarms) or f"<p>{word['none']}</p>"
    yield f"<h2>{word['files']}</h2>"
    yield "".join(f"<p>{escape(file)}</p>" for file in told.files) or f"<p>{word['none']}</p>"


def _contour(error: Mapping[str, Any], word: Mapping[str, str]) -> Iterator[str]:
    """How far the drives have led the tool off its path: the largest, and what was beyond its tolerance."""
    if not (largest := error.get("largest")):
        return
    rows = [_off(word["contour.largest"], largest)]
    rows += [_off(word["contour.beyond"], one) for one in error["excesses"]]
    heads = (word["contour.what"], word["contour.line"], word["joint"], "mm", word["contour.tolerance"])
    yield f"<h2>{word['contour']}</h2>{_table(rows, heads)}"


def _off(what: str, error: Mapping[str, Any]) -> tuple[str, ...]:
    tolerance = error["tolerance_mm"]
    allowed = "–" if tolerance is None else _figure(tolerance)
    return what, str(error["line"]), str(error["axis"]), f"{error['largest_mm']:.4f}", allowed


def _check(check: Mapping[str, Any], word: Mapping[str, str], language: str) -> Iterator[str]:
    verified = check.get("verified") or {}
    rows = [(word[f"check.{key}"], _figure(check[key])) for key in OF_CHECK if check.get(key) is not None]
    rows += [
        (word[f"check.work.{one['what']}"], _figure(one["length_mm"])) for one in check.get("work") or ()
    ]
    verdict = check.get("verdict") or {}
    if verdict:
        rows.append((word["check.form"], messages.text(verdict, language)))
    for key in ("overcut_mm", "undercut_mm"):
        if verified.get(key) is not None:
            rows.append((word[f"check.{key}"], _figure(verified[key])))
    yield f"<h2>{word['check']}</h2>{_table(rows)}"
    joints = [
        (str(joint["name"]), *(f"{joint[key] * 100:.0f} %" for key in SHARES))
        for joint in check.get("joints") or ()
    ]
    if joints:
        yield _table(joints, (word["joint"], *(word[key] for key in SHARES)))


def _as_cut(cut: Mapping[str, Any], word: Mapping[str, str], language: str) -> Iterator[str]:
    """What the drives have cut, beside the check, which is of the plan."""
    yield f"<h2>{word['as_cut']}</h2>"
    if said := cut.get("refused") or cut.get("verdict"):
        yield f"<p>{escape(messages.text(said, language))}</p>"
    rows = [
        (str(one["line"]), *(f"{one[key]:.4f}" for key in ("overcut_mm", "undercut_mm")))
        for one in cut.get("surfaces") or ()
    ]
    yield _table(rows, (word["contour.line"], word["check.overcut_mm"], word["check.undercut_mm"]))


def _table(rows: Sequence[tuple[str, ...]], heads: tuple[str, ...] = ()) -> str:
    if not rows:
        return ""
    head = "".join(f'<th scope="col">{escape(one)}</th>' for one in heads)
    body = "".join(
        f'<tr><th scope="row">{escape(first)}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in more)}</tr>'
        for first, *more in rows
    )
    return f"<table>{f'<thead><tr>{head}</tr></thead>' if head else ''}<tbody>{body}</tbody></table>"


def _figure(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _moment(at_s: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(at_s))
