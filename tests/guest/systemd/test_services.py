"""The machine's services under a real systemd, on a CAN interface with simulated drives."""

from __future__ import annotations

import os

import pytest
from guest.systemd import services
from guest.systemd.services import PANEL, SERVICE, Machine, directrix, run, shown
from living import until

LIMITS = {PANEL: 2.5, SERVICE: 5.0}


def test_both_services_run_as_their_own_users_and_the_status_says_so(machine: Machine) -> None:
    assert machine.off()
    assert "directrix.service: active" in directrix("service", "status")
    owners = [run("stat", "-c", "%U:%G", f"/proc/{shown('MainPID', unit)}").strip() for unit in LIMITS]
    assert owners == ["directrix-panel:directrix", "directrix:directrix"]


@pytest.mark.parametrize("unit", LIMITS)
def test_a_running_service_exposes_no_more_than_it_may(machine: Machine, unit: str) -> None:
    run("systemd-analyze", "security", "--no-pager", f"--threshold={10 * LIMITS[unit]:.0f}", unit)


def test_the_tick_has_the_real_time_that_it_asks_for(machine: Machine) -> None:
    until(lambda: services.pid_of("directrix-tick"))
    pid = services.pid_of("directrix-tick")
    until(lambda: os.sched_getscheduler(pid) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO)
    with open(f"/proc/{pid}/status") as status:
        locked = next(line for line in status if line.startswith("VmLck"))
    assert int(locked.split()[1]) > 0
    assert os.sched_getscheduler(int(shown("MainPID"))) == os.SCHED_OTHER
