"""What a measurement cannot be used for, in a sentence of the catalogue."""

from __future__ import annotations

from controller.messages import TextError, message


class Refusal(TextError, ValueError):
    """One sentence."""

    def __init__(self, key: str, **values: object) -> None:
        super().__init__(message(f"calibration.{key}", **values))
