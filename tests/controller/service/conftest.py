"""A service without processes, for whoever asks for one."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.fakes.fake_engine import FakeEngine, engine_of, served

from controller.service.command_handlers import Desk
from controller.service.service import Service


@pytest.fixture
def service(tmp_path: Path) -> Service:
    """Homed and enabled; nothing is loaded."""
    return served(tmp_path)


@pytest.fixture
def engine(service: Service) -> FakeEngine:
    return engine_of(service)


@pytest.fixture
def desk(service: Service) -> Desk:
    return Desk(service)
