"""What drives report, in English: the words of CiA's tables."""

from __future__ import annotations

from drives import emergency_codes

LANGUAGE = "en"

REFUSALS = {
    "emcy": "{code}h: {what}",
    "emcy.unlisted": emergency_codes.UNLISTED,
    **{f"emcy.{code:04X}": text for code, text in emergency_codes.TEXTS.items()},
}
