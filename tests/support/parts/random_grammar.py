"""Random programs of the whole grammar: ``random_codes`` and arcs inside of subs, loops and choices."""

from __future__ import annotations

import random
import re

from support.parts import random_codes

LENGTHS = ("G43", "G44", "G49")
_NUMBER = re.compile(r"(?<=[XYZA])-?\d+\.?\d*")


def program(rng: random.Random) -> str:
    """A sound program of LinuxCNC's."""
    made = _Program(rng)
    return "\n".join([*made.head(), *made.body(rng.randrange(3, 7), 2), "M2", ""])


class _Program:
    """One program on its way; every O-word has a number of its own."""

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng
        self._label = 100
        self._subs: list[int] = []
        self._inside = False  # a sub, where the names of the program have no value
        self._turns = rng.random() < 0.5

    def head(self) -> list[str]:
        rows = []
        for _ in range(self._rng.randrange(3)):
            self._label += 1
            name, self._inside = self._label, True
            inside = (["M73"] if self._keeps() else []) + self.body(2, 1)
            self._inside = False
            rows += [f"o{name} sub", *inside, self._leaves(name), f"o{name} endsub"]
            self._subs.append(name)
        unit = self._rng.choice(("G21", "G20"))
        return [
            *rows,
            unit,
            "G90 G94 G98 F100 T1 M6",
            "S100 M3 G0 X1 Y2 Z50",
            "#1=2 #<a>=1.5 #<dx>=2.5 #<_glob>=-3",
        ]

    def _keeps(self) -> bool:
        """The interpreter of LinuxCNC 2.9 loses a shift of G92 or G52 that a sub with M73 leaves behind."""
        return self._turns and self._rng.random() < 0.5

    def _leaves(self, name: int) -> str:
        return self._rng.choice((f"o{name} return [#1 + 1]", "(no value)", f"o{name} return"))

    def body(self, count: int, depth: int) -> list[str]:
        return [row for _ in range(count) for row in self._item(depth)]

    def _item(self, depth: int) -> list[str]:
        rng, kind = self._rng, self._rng.random()
        if depth and kind < 0.35:
            return self._structure(depth)
        if self._subs and kind < 0.45:
            return [f"o{rng.choice(self._subs)} call [{random_codes.number(rng)}] [#1]"]
        if kind < 0.6:
            return self._arc()
        if kind < 0.7:
            return [rng.choice(("#1=[#1 + 1]", "#3=[#<_glob> * 2]", "#<_glob>=[abs[#1] - 4]", "#1=2 #2=#1"))]
        if kind < 0.75 and self._turns:
            return ["M70", "G91", *self._line(), "M72"]
        return self._line()

    def _structure(self, depth: int) -> list[str]:
        self._label += 1
        name, count, rng = f"o{self._label}", f"#{500 + self._label}", self._rng
        inside = self.body(rng.randrange(1, 4), depth - 1)
        other = self.body(1, depth - 1)
        value, how = rng.choice(("#1", "#<_glob>", "#3")), rng.choice(("gt", "le", "eq", "ne"))
        test, number = f"[{value} {how} {rng.randrange(4)}]", rng.randrange(4)
        return rng.choice(
            (
                [f"{name} if {test}", *inside, f"{name} else", *other, f"{name} endif"],
                [f"{name} if {test}", *inside, f"{name} elseif [#1 lt 3]", *other, f"{name} endif"],
                [f"{name} repeat [{number}]", *inside, f"{name} endrepeat"],
                [
                    f"{count}=0",
                    f"{name} while [{count} lt {number}]",
                    f"{count}=[{count} + 1]",
                    *inside,
                    f"{name} endwhile",
                ],
                [
                    f"{count}=0",
                    f"{name} do",
                    f"{count}=[{count} + 1]",
                    *inside,
                    f"{name} while [{count} lt 2]",
                ],
            )
        )

    def _line(self) -> list[str]:
        """Of the codes, some of its numbers written as what they come from.

        No length beside M70 to M73: what M72 of LinuxCNC 2.9 makes of it stands in the README of programs.
        """
        rows = random_codes.line(self._rng, self._turns).split("\n")
        if self._turns and any(row.startswith(LENGTHS) for row in rows):
            return self._line()
        return [self._dressed(row) for row in rows]

    def _dressed(self, row: str) -> str:
        rng = self._rng
        if row.startswith(("G10", "G28", "G30", "G43")):
            return row
        if rng.random() < 0.3:
            own = "_glob" if self._inside else rng.choice(("_glob", "dx"))  # two letters are a name as any
            row = _NUMBER.sub(lambda found: f"[{found.group()} + #<{own}> - #<{own}>]", row, count=1)
        return rng.choice(("", "", "N20 ")) + row + rng.choice(("", "", " (said)", " ; so"))

    def _arc(self) -> list[str]:
        """In steps, so that it is sound wherever it begins: half a turn, a whole one, or by its radius."""
        rng = self._rng
        plane, (a, b, up), (i, j) = rng.choice(
            (("G17", "XYZ", "IJ"), ("G18", "ZXY", "KI"), ("G19", "YZX", "JK"))
        )
        x, y = (rng.randrange(1, 9) * rng.choice((0.5, -0.5)) for _ in range(2))
        rise = rng.choice(("", f" {up}{random_codes.number(rng, -5.0, 5.0)}"))
        code = rng.choice(("G2", "G3"))
        move = rng.choice(
            (
                f"{a}{2 * x} {b}{2 * y} {i}{x} {j}{y}{rise}",
                f"{i}{x} {j}{y}{rise}",
                f"{a}{x} {b}{y} R{rng.choice((12, -12))}{rise}",
            )
        )
        return [f"{plane} G91 {code} {move} F{rng.randrange(50, 500)}", "G90 G17"]
