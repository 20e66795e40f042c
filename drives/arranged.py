"""What a drive was found to do once it was commissioned: its units, and how it stops. Values only."""

from __future__ import annotations

from dataclasses import dataclass

from drives.texts import Message


@dataclass(frozen=True, slots=True)
class Arranged:
    """One drive as it was read back."""

    name: str  # of the axis, or "spindle"
    node: int
    velocity_unit_counts_s: float = 1.0  # one of its units of velocity (6099h, 60B1h, 60FFh, 606Ch ...)
    acceleration_unit_counts_s2: float = 1.0  # one of its units of acceleration (6085h, 609Ah ...)
    stop_counts_s2: float = 0.0  # deceleration of its own stops; 0 = it does not tell
    stop_s: float = 0.0  # of such a stop from the axis' largest speed; 0 = no limits were given
    objects: tuple[tuple[str, int], ...] = ()  # as read back: ("6085h:00", 4000)
    notes: tuple[Message, ...] = ()  # for everything that is not as it should be

    @property
    def velocity_units(self) -> float:
        """Units of the drive in one count per second."""
        return 1.0 / self.velocity_unit_counts_s
