"""A state folder has one service at a time, wherever the sockets of another are."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from controller.messages import text
from controller.service.main import alone


def test_a_second_service_on_a_state_folder_is_refused_until_the_first_has_ended(tmp_path: Path) -> None:
    state = tmp_path / "new" / "state"
    with alone(state):
        with pytest.raises(OSError) as refused, alone(state):
            raise AssertionError("two services on one folder")
        assert refused.value.filename == str(state)
        assert text(vars(refused.value)["said"]) == "another service is there; stop it first"
        with alone(tmp_path / "of another machine"):
            pass
        child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    try:
        with alone(state):  # a child that outlives its service holds nothing
            pass
    finally:
        child.communicate()
