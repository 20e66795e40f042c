"""What the drives say of the setpoints that did not come to them: of a run, by axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from controller.state.live_state import Snapshot


def between(axes: Sequence[str], begin: Snapshot, end: Snapshot) -> dict[str, dict[str, Any]]:
    """``missed`` and ``overdue`` of each axis since ``begin``; ``missed`` is None where no drive tells it."""
    return {
        axis: {
            "missed": None if end.missed[i] < 0 else end.missed[i] - max(begin.missed[i], 0),
            "overdue": end.overdue[i] - begin.overdue[i],
        }
        for i, axis in enumerate(axes)
    }
