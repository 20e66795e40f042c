"""Numbers among the arguments of a request; each refusal names the argument, and what it must be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from controller.service.refusals import refused


def number(args: Mapping[str, Any], key: str, lowest: float, highest: float) -> float:
    """A number between two finite bounds, which leaves nan and inf out. Raises CommandRefused."""
    value = args.get(key)
    if not isinstance(value, int | float) or isinstance(value, bool) or not lowest <= value <= highest:
        raise refused("not_number", code="bad", name=key, value=value, lowest=lowest, highest=highest)
    return float(value)


def whole(args: Mapping[str, Any], key: str, below: float = math.inf) -> int | None:
    """A whole number from 0, or None where it is missing or null. Raises CommandRefused."""
    value = args.get(key)
    if value is None:
        return None
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < below:
        raise refused("not_whole", code="bad", name=key, value=value)
    return value
