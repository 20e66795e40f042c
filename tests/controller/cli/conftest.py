"""What tests of several commands stand on."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from argon2 import PasswordHasher
from fastapi.testclient import TestClient
from support.fakes import written_history
from support.fakes.noting_door import NotingDoor
from support.fakes.written_history import WrittenHistory

from controller.api.app_state import Panel
from controller.api.http import make_app
from controller.api.store import Store
from controller.cli import remote


@pytest.fixture
def runtime() -> Iterator[Path]:
    """A folder that is not there yet; its path is short, as that of a socket must be."""
    with tempfile.TemporaryDirectory(prefix="directrix-") as folder:
        yield Path(folder) / "run"


@pytest.fixture
def door() -> NotingDoor:
    return NotingDoor()


@pytest.fixture(scope="module")
def http(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """The application, made once; every test puts a panel of its own behind it."""
    store = Store(tmp_path_factory.mktemp("first"))
    made = make_app(Panel(store, NotingDoor()))
    with TestClient(made, base_url=remote.URL, client=("127.0.0.1", 40000)) as found:
        yield found
    store.close()


@pytest.fixture
def panel(
    http: TestClient, door: NotingDoor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Panel]:
    """The verbs reach this panel, whatever address they are given."""
    monkeypatch.setattr("controller.api.users.PasswordHasher", lambda: PasswordHasher(1, 8, 1))  # quick
    store = Store(tmp_path / "store")
    written_history.begin(store.folder)
    http.app.state.panel = made = Panel(store, door)  # type: ignore[attr-defined]

    @contextlib.contextmanager
    def client(url: str, headers: Mapping[str, str]) -> Iterator[TestClient]:
        http.headers.update(headers)
        yield http
        http.headers.pop("authorization", None)

    monkeypatch.delenv("DIRECTRIX_TOKEN", raising=False)
    monkeypatch.delenv("DIRECTRIX_URL", raising=False)
    monkeypatch.setattr(remote, "client", client)
    yield made
    store.close()


@pytest.fixture
def history(panel: Panel) -> WrittenHistory:
    """What the service of this panel has written of runs and alarms."""
    return WrittenHistory(panel.store.folder)
