"""What a measurement cannot be used for, in a sentence of the catalogue."""

from __future__ import annotations

from controller import messages


class Refusal(ValueError):
    """One sentence: ``said`` is its key and values, ``str`` of it English."""

    def __init__(self, key: str, **values: object) -> None:
        self.said = messages.message(f"calibration.{key}", **values)
        super().__init__(messages.text(self.said))
