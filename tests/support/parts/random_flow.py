"""Random programs of expressions, parameters, subs, choices and loops, for comparisons."""

from __future__ import annotations

import random

# Total ones only: the reference also reads, and refuses, values on lines that it skips.
OPERATORS = ("+", "-", "*", "eq", "ne", "gt", "ge", "lt", "le", "and", "or", "xor")
FUNCTIONS = (
    "abs[{}]",
    "[round[1000 * sin[{}]] / 1000]",
    "[round[1000 * cos[{}]] / 1000]",
    "round[{}]",
    "fix[{}]",
    "fup[{}]",
    "sqrt[abs[{}]]",
)
PARTIAL = (
    "ln[1 + abs[{}]]",
    "exp[[{}] mod 3]",
    "round[asin[[[{}] mod 2] - 1]]",
    "round[acos[[[{}] mod 2] - 1]]",
    "[[{}] / 3]",
    "[[{}] mod 2.5]",
    "[[{}] mod -7]",
    "[[[{}] mod 9] ** 2]",
    "[2 ** [[{}] mod 5] ** 0.5]",
)
LONGEST = 200  # characters; the reference takes 255 in a line, and what is dressed gets longer
READ_ONLY = ("_metric", "_x", "_y", "_z", "_a", "_c", "_absolute", "_call_level", "_plane", "_feed")


class Maker:
    """One random program; a structure never runs long."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.labels = 100
        self.lines: list[str] = []
        self.depth = 0
        self.subs: list[tuple[str, int]] = []
        self.numbered: list[int] = []

    def text(self) -> str:
        self.lines = ["G21 G90 G17 G1 F100 X0 Y0 Z0 A0 C0", "#<a>=1 #<_g>=2 #<two>=2"]
        for _ in range(self.rng.randrange(3)):
            self._sub()
        main = self.lines
        numbered = [self._numbered() for _ in range(self.rng.randrange(2))]
        self.lines = main
        self._body(self.rng.randrange(4, 14))
        self.lines.append("M2")
        self.lines += [line for lines in numbered for line in lines]
        return "".join(self._dressed(line) + "\n" for line in self.lines)

    def _dressed(self, line: str) -> str:
        rng = self.rng
        if rng.random() < 0.1:
            line = line.upper()
        if rng.random() < 0.1 and line[0] not in "oO":  # the reference loses its place by it
            line = f"N{rng.randrange(1000)} {line}"
        if rng.random() < 0.1:
            line += " (note)"
        if rng.random() < 0.1:
            line = line.replace(" ", "  ") + "  ; note"
        return line

    # ---- values

    def value(self, depth: int = 0) -> str:
        rng = self.rng
        kind = rng.random()
        if depth > 2 or kind < 0.35:
            return (
                f"{rng.uniform(-9, 9):.{rng.randrange(4)}f}"
                if rng.random() < 0.7
                else str(rng.randrange(-3, 9))
            )
        if kind < 0.6:
            return self.name()
        if kind < 0.72:
            return rng.choice(FUNCTIONS + PARTIAL).format(self.value(depth + 1))
        if kind < 0.76:
            return f"round[10 * atan[{self.value(depth + 1)}]/[{self.value(depth + 1)}]]"
        if kind < 0.79:
            return f"exists[{rng.choice(('#<a>', '#<_g>', '#<nobody>', '#<_nobody>', '#<local>'))}]"
        inner = f" {rng.choice(OPERATORS)} ".join(self.value(depth + 1) for _ in range(rng.randrange(1, 4)))
        return f"{rng.choice(('', '', '', '-'))}[{inner}]"

    def name(self) -> str:
        rng = self.rng
        if rng.random() < 0.15:
            return f"#<{rng.choice(READ_ONLY)}>"
        if rng.random() < 0.1:
            return f"#{rng.randrange(5420, 5423)}"
        if rng.random() < 0.05:
            return "#[2 + 1]"
        return rng.choice(("#1", "#2", "#3", "#31", "#100", "#<_g>", "#1", "#2"))

    def condition(self) -> str:
        rng = self.rng
        return f"[{self.value(2)} {rng.choice(('eq', 'gt', 'lt', 'ge', 'ne'))} {self.value(2)}]"

    # ---- lines

    def _body(self, count: int) -> None:
        for _ in range(count):
            kind = self.rng.random()
            if self.depth < 3 and kind < 0.25:
                self.depth += 1
                self.rng.choice((self._if, self._while, self._do, self._repeat))()
                self.depth -= 1
            elif kind < 0.35 and self.subs:
                self._call()
            elif kind < 0.38 and self.numbered and not self.depth:  # inside of a loop it loses that
                self.lines.append(f"M98 P{self.rng.choice(self.numbered)} L{self.rng.randrange(1, 3)}")
            elif kind < 0.65:
                self._set()
            elif kind < 0.70:
                self.lines.append(self.rng.choice(("G90", "G91", "M70", "M70", "G4 P0", "G91", "G90")))
            else:
                self._move()

    def _set(self) -> None:
        key = self.rng.choice(("#1", "#2", "#3", "#31", "#100", "#<_g>", "#<a>", "#<local>", "#[1+1]"))
        value = f"[[{self.value()}] mod 50]" if self.rng.random() < 0.7 else self.value()
        self.lines.append(f"{key}={value}")

    def _move(self) -> None:
        rng = self.rng
        axes = rng.sample("XYZAC", rng.randrange(1, 4))
        words = " ".join(f"{axis}[[{self.value()}] mod 300]" for axis in axes)
        if len(words) > LONGEST:
            words = f"X[[{self.value(2)}] mod 300]"
        self.lines.append(f"{rng.choice(('G0', 'G1', 'G1', ''))} {words}".strip())

    def _label(self) -> int:
        self.labels += 1
        return self.labels

    def _if(self) -> None:
        label = self._label()
        self.lines.append(f"o{label} if {self.condition()}")
        self._body(self.rng.randrange(1, 4))
        for _ in range(self.rng.randrange(2)):
            self.lines.append(f"o{label} elseif {self.condition()}")
            self._body(self.rng.randrange(1, 3))
        if self.rng.random() < 0.5:
            self.lines.append(f"o{label} else")
            self._body(self.rng.randrange(1, 3))
        self.lines.append(f"o{label} endif")

    def _leave(self, label: int, *ways: str) -> None:
        """Now and then out of a loop, or to its next round.

        The reference knows neither of repeat, and after a break of while, or a continue of do, it
        ends another loop too early.
        """
        if self.rng.random() < 0.4:
            inner = self._label()
            self.lines.append(f"o{inner} if {self.condition()}")
            self.lines.append(f"o{label} {self.rng.choice(ways)}")
            self.lines.append(f"o{inner} endif")

    def _while(self) -> None:
        label = self._label()
        counter = f"#<_n{label}>"
        self.lines.append(f"{counter}={self.rng.randrange(4)}")
        self.lines.append(f"o{label} while [{counter} gt 0]")
        self.lines.append(f"{counter}=[{counter} - 1]")
        self._body(self.rng.randrange(1, 4))
        self._leave(label, "continue")
        self._body(1)
        self.lines.append(f"o{label} endwhile")

    def _do(self) -> None:
        label = self._label()
        counter = f"#<_n{label}>"
        self.lines.append(f"{counter}={self.rng.randrange(3)}")
        self.lines.append(f"o{label} do")
        self.lines.append(f"{counter}=[{counter} - 1]")
        self._body(self.rng.randrange(1, 4))
        self._leave(label, "break")
        self.lines.append(f"o{label} while [{counter} gt 0]")

    def _repeat(self) -> None:
        label = self._label()
        self.lines.append(f"o{label} repeat [{self.rng.uniform(-1, 4):.1f}]")
        self._body(self.rng.randrange(1, 4))
        self.lines.append(f"o{label} endrepeat")

    # ---- subs

    def _sub(self) -> None:
        rng, label = self.rng, self._label()
        name = f"o{label}" if rng.random() < 0.6 else f"o<sub {label}>"
        self.lines.append(f"{name} sub")
        if rng.random() < 0.3:
            self.lines.append("M73")
        self.depth += 2
        self._body(rng.randrange(2, 6))
        if rng.random() < 0.3:
            inner = self._label()
            self.lines += [
                f"o{inner} if {self.condition()}",
                f"{name} return [{self.value(2)}]",
                f"o{inner} endif",
            ]
            self._body(1)
        self.depth -= 2
        value = f" [{self.value(2)}]" if rng.random() < 0.5 else ""
        self.lines.append(f"{name} endsub{value}")
        self.subs.append((name, rng.randrange(4)))

    def _call(self) -> None:
        name, count = self.rng.choice(self.subs)
        arguments = "".join(f" [{self.value(2)}]" for _ in range(count))
        self.lines.append(f"{name} call{arguments}")
        if self.rng.random() < 0.4:
            self.lines.append("G1 X[[#<_value>] mod 100] Y#<_value_returned>")

    def _numbered(self) -> list[str]:
        label = self._label()
        self.lines = [f"O{label}"]
        self.depth += 2
        subs, self.subs = self.subs, []
        self._body(self.rng.randrange(1, 5))
        self.depth -= 2
        self.subs = subs
        self.numbered.append(label)
        return [*self.lines, "M99"]
