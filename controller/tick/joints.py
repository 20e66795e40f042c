"""Joints to drive counts and back: the last step before the wire."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Final

from controller.machine.kinematics.slides import Slides
from controller.machine.model import Joints, Machine
from controller.tick.deviations import Deviations
from drives.pdo import INT32_MAX

INT32: Final = INT32_MAX + 1


class Encoder:
    """The counts of one tick: ``setpoints`` (int, as sent) and ``actual`` (mm, rad)."""

    def __init__(self, machine: Machine) -> None:
        self._counts_per_unit = tuple(axis.counts_per_unit for axis in machine.axes)
        self._units_per_count = tuple(1.0 / axis.counts_per_unit for axis in machine.axes)
        self._slides, deviations = Slides(machine.axes), Deviations(machine)
        self._deviations = deviations if deviations.found else None
        self.plain = not deviations.found  # setpoints depend on joints alone
        self.reversal_ticks = deviations.reversal_ticks  # that it takes on each axis; 0: it has none
        axes, self._linear = len(machine.axes), machine.linear()
        self._rounded = _of_each("round(a[{0}])", axes)
        self._products = _of_each("a[{0}] * b[{0}]", axes)
        self._encoded: Joints | None = None  # where setpoints depend on joints alone
        self.setpoints: Sequence[int] = (0,) * axes
        self.exact: tuple[float, ...] = (0.0,) * axes  # the same before it was rounded
        self.actual: Sequence[float] = (0.0,) * axes

    def encode(self, joints: Joints) -> bool:
        """Rounds to counts; False (and nothing changed) if one does not fit into an int32."""
        if joints is self._encoded:
            return True
        exact = self.counts(joints)
        counts = self._rounded(exact, exact)
        if min(counts) < -INT32 or max(counts) >= INT32:
            return False
        self.exact, self.setpoints = exact, counts
        self._encoded = joints if self._deviations is None else None
        return True

    def take(self, joints: Joints, exact: tuple[float, ...]) -> None:
        """Rounds ``exact``, which are the ``counts`` of joints alone, and fit."""
        self.exact, self.setpoints, self._encoded = exact, self._rounded(exact, exact), joints

    def counts(self, joints: Joints) -> tuple[float, ...]:
        """Where the drives are to go next, for the axes to be at ``joints``: before it is rounded."""
        sent = joints if self._deviations is None else self._deviations.compensated(joints)
        return self._products(sent, self._counts_per_unit)

    def per_mm(self, direction: Sequence[float]) -> Sequence[float]:
        """Counts of each axis for a mm along a direction of X, Y and Z."""
        linear = dict(zip(self._linear, self._slides.shares(direction), strict=True))
        return [linear.get(i, 0.0) * counts for i, counts in enumerate(self._counts_per_unit)]

    def go_on_as(self, other: Encoder) -> None:
        """What comes next follows the last setpoints of another one."""
        if self._deviations is not None and other._deviations is not None:
            self._deviations.go_on_as(other._deviations)

    def rehearse(self, joints: Joints) -> None:
        """Rounds for the caches alone: nothing changes."""
        products = self._products(joints, self._counts_per_unit)
        self._rounded(products, products)

    def to_units(self, i: int, counts: float) -> float:
        """Counts of one axis in mm or rad."""
        return counts * self._units_per_count[i]

    def decode(self, positions: Sequence[int]) -> None:
        """Takes the drives' positions (counts)."""
        self.actual = self.real(positions)

    def real(self, positions: Sequence[float]) -> Sequence[float]:
        """Where the axes are (mm, rad) where their drives say ``positions`` (counts)."""
        drives = self._products(positions, self._units_per_count)
        return drives if self._deviations is None else self._deviations.real(drives)


@cache
def _of_each(form: str, axes: int) -> Callable[[Sequence[float], Sequence[float]], tuple[Any, ...]]:
    """A formula of a and b, written out for each axis: a loop over five takes twice as long."""
    return eval(f"lambda a, b: ({' '.join(form.format(i) + ',' for i in range(axes))})")  # type: ignore[no-any-return]
