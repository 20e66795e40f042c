"""Lines as an operator types them one after the other: most of them sound in the state that is in force."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping

from controller.program.modal import State

OFFSETS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
ARCS = {"G17": "IJXYZ", "G18": "KIZXY", "G19": "JKYZX"}  # of the centre, of the end, of the way across


class Lines:
    """Of one run; lengths are of like size in both units."""

    def __init__(self, rng: random.Random) -> None:
        self._rng = rng

    def line(self, state: State, work: Mapping[str, float]) -> str:
        """``work``: what the axes read, mm."""
        self._state, self._per_mm = state, 1.0 / state.mm_per_unit
        self._here = {name: value * self._per_mm for name, value in work.items()}
        return self._rng.choice(self._kinds())()

    def _kinds(self) -> tuple[Callable[[], str], ...]:
        one, n, rng = self._one, self._length, self._rng
        return (
            lambda: one("G20", "G21", "G90", "G91", "G98", "G99", "G17", "G18", "G19"),
            lambda: one("G20", "G90", "G91", "G21"),
            lambda: f"{one('G90', 'G91')} {one('G0', 'G1')} {self._places()}",
            lambda: f"{one('G20', 'G21')} G0 X{n()}",
            lambda: f"G92 {self._places()}",
            lambda: one("G92.1", "G92.2", "G92.3"),
            lambda: f"G52 {self._places(rotary=0.0)}",
            lambda: one(*OFFSETS),
            lambda: f"{one('G54', 'G55', 'G59.3')} G0 {self._places()}",
            lambda: one("G43 H1", "G43 H2", "G43", "G49", "G43 H0", f"G43.1 Z{n()}", "G43.2 H1", "G43.2 H2"),
            lambda: f"{one('G43 H1', 'G43 H2', 'G49')} G0 {self._places()}",
            self._cycle,
            self._cycle,
            lambda: self._places(rotary=0.0),
            lambda: self._places(),
            lambda: f"G10 {one('L2', 'L20')} P{rng.randrange(10)} {self._places()}",
            lambda: f"G10 L2 P{rng.randrange(4)} R{rng.uniform(-90.0, 90.0):.2f}",
            lambda: one(f"G10 L1 P2 Z{n()}", f"G10 L10 P2 Z{n()}", f"G10 L11 P1 Z{n()}"),
            lambda: one("T2 M6", "T1 M6", "T2", "T1", "G49 T2 M6"),
            self._feed,
            lambda: f"{self._feed()} S{rng.randrange(100, 5000)}",
            lambda: one(f"S{rng.randrange(100, 5000)}", "M5", "M3 S800", "M4 S900", "S1200 M3", "M3", "M4"),
            lambda: one("G93", "G94", "G95", "G94", "G95 F0.2"),
            lambda: f"G93 G1 {self._places()} F{rng.uniform(1.0, 20.0):.2f}",
            lambda: one("M7", "M8", "M9", "M7 M8", "M8 M3 S300"),
            lambda: one("M48", "M49", "M50 P0", "M50 P1"),
            lambda: one(f"#1={n()}", "#<_k>=2", f"#<p>={n()}", f"#600={n()}", "#3=#1 #1=[#1*2]"),
            lambda: one("G0 X#1", "G0 Y#<_k>", "G0 Z#<p>", "G0 X#600 Y#3", "G1 X#4 #4=2", "G0 X[#5420+1]"),
            lambda: one("G28", "G30", "G28.1", "G30.1", f"G28 Z{n()}", f"G30 Z{n()} X{n()}", f"G28 X{n()}"),
            self._arc,
            self._arc,
            self._arc,
            lambda: f"G53 {one('G0', 'G1')} {self._places()}",
            lambda: one("G61", "G61.1", "G64", "G64 P0.01", "G80", "G40", "G90.1", "G91.1", "G4 P0.1"),
            lambda: f"G0 {self._places()}",
            lambda: f"G1 {self._places()} {self._feed()}",
            lambda: f"G1 {self._places()}",
            lambda: one("M70", "M72", "G40 G1 X3", "M0", "M1"),
            lambda: f"{one('G41 D1', 'G42 D2', 'G42 D1')}{one('', f' G1 X{n()} Y{n()}')}",
        )

    def _one(self, *texts: str) -> str:
        return self._rng.choice(texts)

    def _length(self, most: float = 9.0, least: float | None = None) -> str:
        return f"{self._rng.uniform(-most if least is None else least, most) * self._per_mm:.4f}"

    def _feed(self) -> str:
        return f"F{self._length(900.0, 50.0)}"

    def _places(self, letters: str = "XYZ", rotary: float = 0.15) -> str:
        chosen = [letter for letter in letters if self._rng.random() < 0.6] or [self._rng.choice(letters)]
        words = [letter + self._length() for letter in chosen]
        return " ".join(words + [f"A{self._rng.uniform(-40.0, 40.0):.2f}"] * (self._rng.random() < rotary))

    def _arc(self) -> str:
        rng, state = self._rng, self._state
        i, j, a, b, across = ARCS[state.modal.plane]
        code = self._one("G2", "G3")
        if rng.random() < 0.5:
            large = rng.choice((1, 1, -1)) * rng.uniform(12.0, 20.0) * self._per_mm
            return f"{code} {a}{self._length()} {b}{self._length()} R{large:.4f}"
        radius, begin = rng.uniform(2.0, 8.0) * self._per_mm, rng.uniform(0.0, 6.28)
        end = begin + rng.uniform(0.5, 5.5)
        centre = [-radius * math.cos(begin), -radius * math.sin(begin)]
        there = [centre[0] + radius * math.cos(end), centre[1] + radius * math.sin(end)]
        here = self._here[a], self._here[b]
        if state.absolute:
            there = [p + q for p, q in zip(there, here, strict=True)]
        if state.centres_absolute:
            centre = [p + q for p, q in zip(centre, here, strict=True)]
        words = f"{code} {a}{there[0]:.5f} {b}{there[1]:.5f} {i}{centre[0]:.5f} {j}{centre[1]:.5f}"
        return words + f" {across}{self._length()}" * (rng.random() < 0.3)

    def _cycle(self) -> str:
        rng, across = self._rng, ARCS[self._state.modal.plane][4]
        code = self._one("G81", "G82", "G83", "G73", "G86")
        above = rng.uniform(-3.0, 5.0) if self._state.absolute else -rng.uniform(0.0, 4.0)
        clearance = above * self._per_mm + (self._here[across] if self._state.absolute else 0.0)
        bottom = (clearance if self._state.absolute else 0.0) - rng.uniform(1.0, 9.0) * self._per_mm
        words = f"{code} {self._places('XYZ'.replace(across, ''), 0.0)} {across}{bottom:.4f} R{clearance:.4f}"
        words += " P0.2" * (code in ("G82", "G86"))
        words += f" Q{self._length(4.0, 0.7)}" * (code in ("G83", "G73"))
        return words + f" L{rng.randrange(1, 3)}" * (rng.random() < 0.2)
