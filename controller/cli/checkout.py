"""What of Directrix is no part of an installation: the tests' folder, with benchmarks and soak."""

from __future__ import annotations

from pathlib import Path

import controller
from controller.verify.console import Refused, say


def tests() -> Path:
    """The folder ``tests`` of the checkout that this is run from. Raises Refused where there is none."""
    found = Path(controller.__file__).resolve().parents[1] / "tests"
    if not (found / "support").is_dir():
        raise Refused(say("checkout.none", folder=found))
    return found
