"""Programs that mean harm or had bad luck: surfaces that cannot be, numbers that nobody means, torn lines.

    python tests/support/parts/hostile_programs.py FIRST COUNT [SECONDS]

checks so many of them, numbered from FIRST, in this process and tells which are neither planned nor
refused with a place in the program.
"""

from __future__ import annotations

import math
import random
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from support.parts import vertical_rulings  # noqa: E402
from support.parts.nurbs_text import number  # noqa: E402

from controller.machine import machine_file  # noqa: E402
from controller.machine.model import Machine  # noqa: E402
from controller.program.program import ProgramError  # noqa: E402
from controller.runtime import checked  # noqa: E402

Point = list[float]
MACHINES = ("shop", "shop", "fig4b", "fig4c", "fig4d", "head_head", "table_head", "oblique45")
MAX_S = 60.0  # of the processor, for one check
HUGE = (1e4, 1e6, 1e9, 1e15, 1e30, 1e150, 1e300)
TINY = (1e-3, 1e-5, 1e-6, 1e-7, 1e-9, 1e-12, 1e-30, 1e-300)
WORDS = (
    *("X", "X.", "X-", "X--5", "X1.2.3", "X1e5", "Xnan", "X[1/0]", "X[SQRT[-1]]", "X[0**-1]", "X[10**400]"),
    *("XNAN", "Xinf", "X[LN[0]]", "X[ASIN[2]]", "X[EXP[1000]]", "X#99999", "#5=", "[", "]", "(", "%", ";"),
    *("G52", "G51", "G6.2", "G64 P0", "G91", "G93", "G94", "G20", "G40 Q-0.1", "G41 P2", "G42 Q99.", "G55"),
    *("G41 D1", "G42.1 D6.", "G41.1 D-1e4"),
    *("G43.5", "G43.4 H1", "G49", "G61", "G2", "G3", "G1 X1.", "G0", "G99", "M6", "T99", "T2", "M5", "M30"),
    *("S0", "S1e9", "F0", "F-1.", "F1e-4", "D0", "D1080.", "D99999999", "H0", "R-1.", "K1"),
    *("\u00b2", "\x00", "\u0661"),
)


def number_of(r: random.Random) -> float:
    """Any number: mostly a sound one."""
    kind = r.random()
    sign = r.choice((-1.0, 1.0))
    if kind < 0.6:
        return r.uniform(-20.0, 20.0)
    if kind < 0.75:
        return 0.0
    if kind < 0.85:
        return sign * r.choice(TINY)
    return sign * r.choice(HUGE) if kind < 0.92 else sign * float(r.randint(0, 40))


def wall(r: random.Random, count: int = 4) -> tuple[list[Point], list[Point]]:
    """A sound wall of so many control points."""
    heading, length, height = r.uniform(-math.pi, math.pi), r.uniform(5.0, 30.0), r.uniform(4.0, 14.0)
    lower = []
    for k in range(count):
        along, aside = length * k / (count - 1), r.uniform(-2.0, 2.0)
        x, y = math.cos(heading) * along - math.sin(heading) * aside, math.sin(heading) * along
        lower.append([x, y + math.cos(heading) * aside, 0.0])
    lean = [r.uniform(-3.0, 3.0), r.uniform(-3.0, 3.0), height]
    upper = [[a + b + r.uniform(-0.8, 0.8) for a, b in zip(p, lean, strict=True)] for p in lower]
    return upper, lower


def _coincident(r: random.Random, upper: list[Point], lower: list[Point]) -> None:
    curve = r.choice((upper, lower))
    i, j = r.randrange(len(curve)), r.randrange(len(curve))
    curve[i] = list(r.choice((upper, lower))[j])


def _standing(r: random.Random, upper: list[Point], lower: list[Point]) -> None:
    """The first or last tangents are nothing."""
    for curve in r.choice(((upper,), (lower,), (upper, lower))):
        n, order = r.randint(2, len(curve)), slice(None, None, r.choice((-1, 1)))
        row = curve[order]
        for k in range(1, n):
            row[k][:] = row[0]


def _short(r: random.Random, upper: list[Point], lower: list[Point]) -> None:
    """Rulings of no or next to no length."""
    size = r.choice((0.0, 0.0, *TINY))
    for k in range(len(upper)):
        if r.random() < 0.6:
            upper[k] = [a + size * r.uniform(-1.0, 1.0) for a in lower[k]]


def _cusp(r: random.Random, upper: list[Point], lower: list[Point]) -> None:
    curve = r.choice((upper, lower))
    ends = curve[0], curve[-1]
    over = r.uniform(1.0, 6.0)
    curve[1] = [a + over * (b - a) for a, b in zip(*ends, strict=True)]
    curve[-2] = [b + over * (a - b) for a, b in zip(*ends, strict=True)]


def _folded(r: random.Random, upper: list[Point], lower: list[Point]) -> None:
    way = r.randrange(4)
    if way == 0:
        upper.reverse()
    elif way == 1:
        r.shuffle(r.choice((upper, lower)))
    elif way == 2:
        upper[:], lower[:] = lower[:], upper[:]
    else:
        for p in upper:
            p[2] = r.choice((0.0, lower[0][2], p[2]))


def _strange(r: random.Random, upper: list[Point], lower: list[Point]) -> None:
    for _ in range(r.randint(1, 4)):
        r.choice(r.choice((upper, lower)))[r.randrange(3)] = number_of(r)


def _scaled(r: random.Random, upper: list[Point], lower: list[Point]) -> None:
    size = r.choice((*TINY, *HUGE, 0.01, 0.1, 10.0, 100.0))
    for p in (*upper, *lower):
        p[:] = [size * a for a in p]


def _flat(r: random.Random, upper: list[Point], lower: list[Point]) -> None:
    axis = r.randrange(3)
    value = number_of(r)
    for p in r.choice((upper, lower, [*upper, *lower])):
        p[axis] = value


def _upright(r: random.Random, upper: list[Point], lower: list[Point]) -> None:
    """Rulings that are vertical at some control points, or nearly."""
    off = r.choice((0.0, 0.0, 1e-9, 1e-6, 1e-3))
    for p, q in zip(upper, lower, strict=True):
        if r.random() < 0.7:
            p[:2] = [a + off * r.uniform(-1.0, 1.0) for a in q[:2]]


def _level(r: random.Random, upper: list[Point], lower: list[Point]) -> None:
    """Curves that do not go on, or only upwards."""
    for p, q in zip(upper, lower, strict=True):
        if r.random() < 0.8:
            q[:2] = lower[0][:2]
        if r.random() < 0.3:
            p[:2] = upper[0][:2]


Spoil = Callable[[random.Random, list[Point], list[Point]], None]
SPOILS: tuple[Spoil, ...] = (
    *(_coincident, _standing, _short, _cusp, _folded, _strange, _scaled, _flat, _upright, _level),
)


def spoilt(r: random.Random, count: int = 4) -> tuple[list[Point], list[Point]]:
    upper, lower = wall(r, count)
    for _ in range(r.choice((0, 1, 1, 1, 2, 3))):
        r.choice(SPOILS)(r, upper, lower)
    return upper, lower


def word(letter: str, value: float, r: random.Random) -> str:
    if r.random() < 0.02:
        return f"{letter}{int(value) if abs(value) < 1e15 else 0}"  # counts hundredths
    decimals = r.choice((2, 3, 3, 4, 6, None))
    shown = value if decimals is None or abs(value) > 1e12 else round(value, decimals)
    return letter + number(shown)


def feed(r: random.Random) -> str:
    feeds = "F600. F1000. F1000. F3000. F60000 F100 F0.001 F1e6 F9999999. F0 F-5."
    return r.choice(feeds.split())


def ruled(r: random.Random) -> str:
    upper, lower = spoilt(r)
    rows = [" ".join(word(a, c, r) for a, c in zip("XYZ", p, strict=True)) for p in (*upper, *lower)]
    return "\n".join([f"G52 {rows[0]} {feed(r)}", *rows[1:]])


def joined(r: random.Random) -> str:
    """Two walls that meet, nearly meet, or do not."""
    upper, lower = spoilt(r)
    more_u, more_l = wall(r)
    gap = r.choice((0.0, 0.0, *TINY[:6], 0.01))
    for there, here in ((more_u, upper), (more_l, lower)):
        shift = [b - a + gap * r.uniform(-1.0, 1.0) for a, b in zip(there[0], here[-1], strict=True)]
        for p in there:
            p[:] = [a + d for a, d in zip(p, shift, strict=True)]
    text = []
    for points in ((*upper, *lower), (*more_u, *more_l)):
        rows = [" ".join(f"{a}{number(c)}" for a, c in zip("XYZ", p, strict=True)) for p in points]
        text += [f"G52 {rows[0]} F1000.", *rows[1:]]
    return "\n".join(text)


def cone(r: random.Random) -> str:
    radius, turn = r.uniform(5.0, 30.0), r.uniform(-math.pi, math.pi)
    values = {
        "X": radius * math.cos(turn), "Y": radius * math.sin(turn), "Z": 0.0, "I": 0.0, "J": 0.0, "K": 0.0,
        "H": r.uniform(2.0, 14.0), "R": r.uniform(0.0, 30.0), "D": r.uniform(-200.0, 200.0),
    }  # fmt: skip
    for _ in range(r.choice((0, 1, 1, 2))):
        letter = r.choice("XYZIJKHRDD")
        values[letter] = r.choice((number_of(r), number_of(r), 1080.0, -1080.0, 36001.0, 1e-9, 720.0))
    return "G51 " + " ".join(word(a, v, r) for a, v in values.items()) + " " + feed(r)


def _knots(r: random.Random, order: int, count: int) -> list[float]:
    inner = sorted(r.choice((r.random(), 0.5, 0.25)) for _ in range(max(0, count - order)))
    knots = [0.0] * order + inner + [1.0] * order
    kind = r.random()
    if kind < 0.15:
        knots[r.randrange(len(knots))] = number_of(r)
    elif kind < 0.2:
        knots = [0.0] * len(knots)
    elif kind < 0.25:
        knots.reverse()
    elif kind < 0.35:
        scale = r.choice((*TINY, *HUGE))
        knots = [scale * k for k in knots]
    return knots


def nurbs(r: random.Random) -> str:
    count = r.choice((*range(2, 9), 40))
    curves = spoilt(r, max(count, 4))
    orders = [r.choice((2, 3, 4, 4, 5, 8, 1, 9)) if r.random() < 0.3 else min(count, 4) for _ in curves]
    lines = [f"G6.2 P{orders[0]} Q{orders[1]} {feed(r)}"]
    for points, order in zip(curves, orders, strict=True):
        knots = _knots(r, order, len(points))
        weighed = r.random() < 0.5
        for knot, p in zip(knots, points, strict=False):
            weight = r.choice((1.0, r.uniform(0.5, 2.0), r.uniform(0.5, 2.0)))
            if r.random() < 0.03:
                weight = r.choice((0.0, -1.0, *TINY, *HUGE))
            row = " ".join(f"{a}{number(c)}" for a, c in zip("XYZ", p, strict=True))
            lines.append(f"K{number(knot)} {row}" + (f" R{number(weight)}" if weighed else ""))
        lines += [f"K{number(knot)}" for knot in knots[len(points) :]]
    return "\n".join(lines)


def tool_lines(r: random.Random) -> str:
    mode = r.choice(("G43.4", "G43.5"))
    letters = "XYZAC" if mode == "G43.4" else "XYZIJK"
    lines = [mode, r.choice(("G61", "G64 P0.01", "G64 P0.1 Q1", "G64 P1e6"))]
    if mode == "G43.5":
        lines.append("G0 X0 Y0 Z30. I0 J0 K1")
    for _ in range(r.randint(1, 12)):
        words = [word(a, number_of(r), r) for a in letters if r.random() < 0.7]
        lines.append(f"G{r.choice('0111')} {' '.join(words)} {feed(r)}")
    return "\n".join([*lines, "G49"])


def arcs(r: random.Random) -> str:
    lines = []
    for _ in range(r.randint(1, 5)):
        letters = r.choice(("XYIJ", "XYR", "XYZIJ", "XZIK", "XYIJP"))
        words = [word(a, number_of(r), r) for a in letters]
        lines.append(f"G{r.choice('23')} {' '.join(words)} {feed(r)}")
    return "\n".join(lines)


def vertical(r: random.Random) -> str:
    """A wall whose ruling touches the vertical, one word of it another one."""
    make = r.choice((vertical_rulings.random_ruled, vertical_rulings.random_rational))
    source = make(r.randrange(10**6)).source
    rows = source.splitlines()[4:-3]
    if r.random() < 0.6:
        i = r.randrange(len(rows))
        words = rows[i].split()
        j = r.randrange(len(words))
        words[j] = words[j][:1] + number(number_of(r))
        rows[i] = " ".join(words)
    return "\n".join(rows)


PARTS = (ruled, ruled, ruled, joined, cone, cone, nurbs, nurbs, tool_lines, arcs, vertical, vertical)


def program(seed: int) -> tuple[str, bytes]:
    """The name of a machine, and a program for it."""
    r = random.Random(seed)
    side = r.choice(("G41", "G42", "G40", "G41 P1", "G42 P1", "G42 P2", "G41 Q0.5", "G42 Q-0.02"))
    head = [r.choice(("G21 G90 G54 G61", "G21 G90 G54 G64 P0.01", "G20 G90 G54")), f"T{r.choice('1223')} M6"]
    parts = [r.choice(PARTS)(r) for _ in range(r.choice((1, 1, 1, 2)))]
    text = "\n".join([*head, "S12000 M3", side, *parts, "G40", "M5", "M30", ""])
    if r.random() < 0.25:
        text = torn(r, text)
    name = r.choice(MACHINES)
    text = text.replace("G54", "G55", 1) if name == "shop" and seed % 2 else text
    return name, text.encode("utf-8", "surrogateescape")


def torn(r: random.Random, text: str) -> str:
    """Words and lines taken out, doubled, exchanged, or others put in."""
    lines = text.split("\n")
    for _ in range(r.randint(1, 3)):
        i = r.randrange(len(lines))
        kind = r.randrange(6)
        if kind == 0:
            del lines[i : i + r.randint(1, 2)]
            lines = lines or [""]
        elif kind == 1:
            lines.insert(i, lines[r.randrange(len(lines))])
        elif kind == 2:
            lines[i] = f"{lines[i]} {r.choice(WORDS)}"
        elif kind == 3:
            words = lines[i].split() or [""]
            words[r.randrange(len(words))] = r.choice(WORDS)
            lines[i] = " ".join(words)
        elif kind == 4:
            lines[i] = lines[i][: r.randrange(len(lines[i]) + 1)]
        else:
            at = r.randrange(len(lines[i]) + 1)
            lines[i] = lines[i][:at] + chr(r.choice((0, 9, 35, 37, 45, 46, 64, 91, 233))) + lines[i][at:]
    return "\n".join(lines)


def outcome(made: Machine, text: bytes, folder: Path) -> str:
    """'planned', or the sentence of the refusal; raises whatever else is raised."""
    try:
        checked.check(checked.task(text, "part.ngc", made), folder)
    except ProgramError as error:
        lines = text.count(b"\n") + 1
        if not (1 <= error.line <= lines and error.column >= 1 and error.sentence):
            raise RuntimeError(f"no place of {lines} lines: {error}") from error
        if any(lost in error.sentence for lost in ("nan", "Traceback", "None")):
            raise RuntimeError(f"no reason: {error}") from error
        return error.sentence
    return "planned"


class Slow(Exception):
    """A check does not end."""


def _slow(*_: object) -> None:
    raise Slow("the check does not end")


def run(first: int, count: int, seconds: float) -> int:
    """How many go wrong; each is told with its seed."""
    machines = {name: machine_file.load(name) for name in MACHINES}
    wrong, said, began = Counter[str](), Counter[str](), time.monotonic()
    signal.signal(signal.SIGPROF, _slow)
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            if time.monotonic() - began > seconds:
                count = seed - first
                break
            name, text = program(seed)
            signal.setitimer(signal.ITIMER_PROF, MAX_S)
            try:
                said[outcome(machines[name], text, Path(folder))[:40]] += 1
            except Exception as error:
                frame = traceback.extract_tb(error.__traceback__)[-1]
                what = f"{type(error).__name__} in {Path(frame.filename).name}:{frame.lineno}: {error}"
                wrong[what[:90]] += 1
                if wrong[what[:90]] <= 3:
                    print(f"seed {seed} on {name}: {what}", flush=True)
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
    print(f"{count} programs from {first}, {said['planned']} planned, {wrong.total()} wrong: {wrong}")
    return wrong.total()


if __name__ == "__main__":
    figures = [*sys.argv[1:], "1e9"]
    sys.exit(min(1, run(int(figures[0]), int(figures[1]), float(figures[2]))))
