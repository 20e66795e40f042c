"""A mistake of our own, as it is told to whoever met it."""

from __future__ import annotations

import traceback
from pathlib import Path


def summary(error: BaseException) -> str:
    """Its kind, place and words on one line: ``ValueError in mesh.py, line 12: ...``."""
    frame = traceback.extract_tb(error.__traceback__)[-1] if error.__traceback__ else None
    where = f" in {Path(frame.filename).name}, line {frame.lineno}" if frame else ""
    words = " ".join(str(error).split())
    return f"{type(error).__name__}{where}{': ' if words else ''}{words}"
