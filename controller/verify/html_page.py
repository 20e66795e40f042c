"""Pages of HTML that need no other file, with lines over two scales as SVG."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

WIDTH, HEIGHT = 860, 340
LEFT, RIGHT, TOP, BOTTOM = 70, 16, 28, 44  # margins
COLOURS = ("#0b5cad", "#b3470b", "#2c7a2c", "#7b3aa5", "#8a6d00", "#00727a")
DASHES = ("", "6 3", "2 3", "8 3 2 3", "1 2", "10 4")
GREY = "#bbb"
MARKS = 6  # of a scale, about
MAX_FINE_DECADES = 4  # with marks between their powers of ten
STEPS = (1.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True, slots=True)
class Line:
    """A name with places, which are joined in their order."""

    name: str
    x: Sequence[float]
    y: Sequence[float]


@dataclass(frozen=True, slots=True)
class Scale:
    """From values, of which ``low`` is at ``begin`` (px) and ``high`` at ``end``."""

    low: float
    high: float
    begin: float
    end: float
    is_log: bool = False

    def at(self, value: float) -> float:
        low, high = self.low, self.high
        if self.is_log:
            low, high, value = (math.log10(max(one, self.low)) for one in (low, high, value))
        share = (value - low) / (high - low or 1.0)
        return self.begin + (self.end - self.begin) * min(max(share, 0.0), 1.0)

    def marks(self) -> list[float]:
        """Round values on it."""
        if self.is_log:
            first, last = math.floor(math.log10(self.low)), math.ceil(math.log10(self.high))
            steps = STEPS[:3] if last - first <= MAX_FINE_DECADES else STEPS[:1]
            found = [step * 10.0**n for n in range(first, last + 1) for step in steps]
        else:
            rough = (self.high - self.low) / MARKS or 1.0
            power = 10.0 ** math.floor(math.log10(rough))
            step = power * next(one for one in STEPS if one * power >= rough * (1.0 - 1e-9))
            found = [step * n for n in range(math.floor(self.low / step), math.ceil(self.high / step) + 1)]
        return [one for one in found if self.low * (1 - 1e-9) <= one <= self.high * (1 + 1e-9) or one == 0.0]


def lines(title: str, words: tuple[str, str], drawn: Sequence[Line], log_x: bool = False) -> str:
    """The picture; ``words``: below, and at the top of the upright scale. It is "" without places."""
    drawn = [one for one in drawn if len(one.x)]
    if not drawn:
        return ""
    x = Scale(*_span([v for one in drawn for v in one.x]), LEFT, WIDTH - RIGHT, log_x)
    y = Scale(*_padded([v for one in drawn for v in one.y]), HEIGHT - BOTTOM, TOP)
    return on_scales(title, words, drawn, x, y)


def on_scales(
    title: str, words: tuple[str, str], drawn: Sequence[Line], x: Scale, y: Scale, more: str = ""
) -> str:
    """The same on scales that are given, from ``LEFT`` to ``WIDTH - RIGHT`` and from ``HEIGHT - BOTTOM`` to
    ``TOP``.

    ``more``: elements under the lines, such as a ``limit``.
    """
    return svg(title, [*_frame(x, y, words), more, *_curves(drawn, x, y)])


def limit(scale: Scale, value: float, words: str) -> str:
    """A line across the picture at a value of one of its scales, with its name."""
    at, is_level = scale.at(value), scale.begin > scale.end
    x1, x2, y1, y2 = (LEFT, WIDTH - RIGHT, at, at) if is_level else (at, at, TOP, HEIGHT - BOTTOM)
    place = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
    name = text(LEFT + 6, at - 5, words, "start") if is_level else text(at - 6, TOP + 14, words, "end")
    return f'<line class="limit" {place} stroke="#c00" stroke-width="1.2"/>{name}'


def circle(title: str, words: tuple[str, str], drawn: Sequence[Line]) -> str:
    """The same with both scales alike: what is round stays round."""
    drawn = [one for one in drawn if len(one.x)]
    if not drawn:
        return ""
    size = max(abs(v) for one in drawn for v in (*one.x, *one.y)) * 1.05
    half = 0.5 * (HEIGHT - TOP - BOTTOM)
    x = Scale(-size, size, WIDTH / 2 - half, WIDTH / 2 + half)
    return on_scales(title, words, drawn, x, Scale(-size, size, HEIGHT - BOTTOM, TOP))


def _span(values: Sequence[float]) -> tuple[float, float]:
    return min(values), max(values)


def _padded(values: Sequence[float]) -> tuple[float, float]:
    low, high = _span(values)
    room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room


def _frame(x: Scale, y: Scale, words: tuple[str, str]) -> Iterator[str]:
    for mark in y.marks():
        at = y.at(mark)
        yield f'<line x1="{x.begin:.1f}" y1="{at:.1f}" x2="{x.end:.1f}" y2="{at:.1f}" stroke="{GREY}"/>'
        yield text(x.begin - 6, at + 4, _figure(mark), "end")
    for mark in x.marks():
        at = x.at(mark)
        yield f'<line x1="{at:.1f}" y1="{y.begin}" x2="{at:.1f}" y2="{y.begin + 5}" stroke="#111"/>'
        yield text(at, y.begin + 18, _figure(mark), "middle")
    yield text((x.begin + x.end) / 2, HEIGHT - 8, words[0], "middle")
    yield text(x.begin, TOP - 12, words[1], "start")


def _figure(mark: float) -> str:
    return f"{mark:.0f}" if abs(mark) >= 1000.0 else f"{mark:.4g}"


def _curves(drawn: Sequence[Line], x: Scale, y: Scale) -> Iterator[str]:
    """Lines with their names; told apart by their dashes, too."""
    for number, one in enumerate(drawn):
        pen = f'stroke="{COLOURS[number % len(COLOURS)]}" stroke-dasharray="{DASHES[number % len(DASHES)]}"'
        places = " ".join(f"{x.at(a):.1f},{y.at(b):.1f}" for a, b in zip(one.x, one.y, strict=True))
        yield f'<polyline fill="none" stroke-width="1.5" {pen} points="{places}"/>\n'
        if one.name:
            at = TOP + 10 + 17 * number
            yield f'<line x1="{WIDTH - 220}" y1="{at}" x2="{WIDTH - 185}" y2="{at}" {pen}/>'
            yield text(WIDTH - 178, at + 4, one.name, "start")


def text(x: float, y: float, words: str, anchor: str) -> str:
    """Words at a place; ``anchor``: start, middle or end of them."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>'


def svg(title: str, parts: Sequence[str]) -> str:
    """A picture of these elements."""
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" xmlns="http://www.w3.org/2000/svg">'
        f"<title>{escape(title)}</title>\n{''.join(parts)}</svg>\n"
    )


# ---- the page -------------------------------------------------------------------------


STYLE = (
    "body{font:16px/1.45 sans-serif;margin:2rem auto;max-width:56rem;padding:0 1rem;color:#111;"
    "background:#fff}"
    "table{border-collapse:collapse;margin:.5rem 0 1.5rem;font-size:.92rem}"
    "th,td{text-align:left;padding:.25rem .9rem .25rem 0;border-bottom:1px solid #bbb;vertical-align:top}"
    "td{font-variant-numeric:tabular-nums}svg{max-width:100%;height:auto}text{font:12px sans-serif}"
)


def document(title: str, language: str, body: str) -> str:
    """The whole of it; ``title`` is its heading, too."""
    title = escape(title)
    return (
        f'<!doctype html>\n<html lang="{language}"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head>\n<body><h1>{title}</h1>\n{body}</body></html>\n"
    )


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Each row begins with its name; without ``heads`` there is no first row."""
    head = "".join(f'<th scope="col">{escape(one)}</th>' for one in heads)
    body = "".join(
        f'<tr><th scope="row">{escape(first)}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in more)}</tr>'
        for first, *more in rows
    )
    return f"<table>{f'<thead><tr>{head}</tr></thead>' if head else ''}<tbody>{body}</tbody></table>\n"
