"""These tests need a real systemd and are run by ``run --systemd``; elsewhere they are not collected."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

HERE = os.environ.get("DIRECTRIX_GUEST") == "systemd"
collect_ignore_glob = [] if HERE else ["test_*.py"]

if HERE:
    from guest import on_can
    from guest.systemd import services

    @pytest.fixture(scope="session")
    def installed() -> Iterator[None]:
        """The services, installed for the shipped machine on vcan0; nothing runs yet."""
        services.prepare()
        services.directrix("service", "install", "--unlocked", "--machine", str(services.MACHINE))
        # Before the panel makes the store: root's must be one that the panel can write.
        services.directrix("tokens", "add", "root", "--state", str(services.STATE))
        yield
        services.directrix("service", "uninstall")

    @pytest.fixture(scope="session")
    def drives(installed: None) -> Iterator[None]:
        with on_can.drives(services.INTERFACE):
            yield
            services.stop()

    @pytest.fixture
    def machine(drives: None) -> Iterator[services.Machine]:
        """Both services, running; a start takes long in a guest, so they go on from test to test."""
        made = services.start()
        yield made
        print(services.told())  # shown where the test failed
        if services.active():
            services.until(made.back_to_off, made.status)
