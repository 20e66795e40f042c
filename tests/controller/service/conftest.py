"""A service without processes, for whoever asks for one; what looks on in its threads ends with the test."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_engine import FakeEngine, engine_of, served

from controller.service.command_handlers import CommandHandlers
from controller.service.service import Service


@pytest.fixture(autouse=True)
def ended(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Hundreds of services that look on would be what the tests behind them wait for."""
    begun: list[Any] = []
    for one in (Service, CommandHandlers):
        monkeypatch.setattr(one, "__init__", noting(begun, one.__init__))
    yield
    for made in reversed(begun):
        made.close()


def noting(begun: list[Any], begin: Any) -> Any:
    def begins(made: Any, *args: Any, **more: Any) -> None:
        begin(made, *args, **more)
        begun.append(made)

    return begins


@pytest.fixture
def service(tmp_path: Path) -> Service:
    """Homed and enabled; nothing is loaded."""
    return served(tmp_path)


@pytest.fixture
def engine(service: Service) -> FakeEngine:
    return engine_of(service)


@pytest.fixture
def desk(service: Service) -> CommandHandlers:
    return CommandHandlers(service)
