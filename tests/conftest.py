"""What holds for every test: nothing is written into the home of the user who runs them.

And for those marked ``live``: a computer that was not there fails none of them, see held_up.py.
"""

from __future__ import annotations

from pathlib import Path

import held_up
import pytest


@pytest.fixture(autouse=True)
def own_state_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stored checks of one test are not found by another."""
    folder = tmp_path_factory.mktemp("state")
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    return folder


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    if item.get_closest_marker("live") is None:
        return None
    held_up.run(item, nextitem)
    return True
