"""The machine's services under a real systemd, on a CAN interface with simulated drives."""

from __future__ import annotations

import os
import signal

import httpx
import pytest
from guest import on_can
from guest.systemd import services
from guest.systemd.services import (
    PANEL,
    SERVICE,
    STATE,
    TARGET,
    Machine,
    Witness,
    active,
    directrix,
    restarts,
    run,
    shown,
    until,
)

LIMITS = {PANEL: 1.2, SERVICE: 1.7}
API = "http://127.0.0.1:8080/api/v1"


def test_both_services_run_as_their_own_users_and_the_status_says_so(machine: Machine) -> None:
    assert machine.off()
    assert "directrix.service: active" in directrix("service", "status")
    owners = [run("stat", "-c", "%U:%G", f"/proc/{shown('MainPID', unit)}").strip() for unit in LIMITS]
    assert owners == ["directrix-panel:directrix", "directrix:directrix"]
    assert run("systemctl", "is-enabled", TARGET).strip() == "enabled"


@pytest.mark.parametrize("unit", LIMITS)
def test_a_running_service_exposes_no_more_than_it_may(machine: Machine, unit: str) -> None:
    run("systemd-analyze", "security", "--no-pager", f"--threshold={10 * LIMITS[unit]:.0f}", unit)


def test_the_tick_has_the_real_time_that_it_asks_for(machine: Machine) -> None:
    pid = until(lambda: services.pid_of("directrix-tick"))
    until(lambda: os.sched_getscheduler(pid) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO)
    with open(f"/proc/{pid}/status") as status:
        locked = next(line for line in status if line.startswith("VmLck"))
    assert int(locked.split()[1]) > 0
    assert os.sched_getscheduler(int(shown("MainPID"))) == os.SCHED_OTHER


def test_the_self_test_finds_the_running_tick_and_its_interface(machine: Machine) -> None:
    lines = directrix("service", "self-test", "--seconds", "0.5", check=False).splitlines()
    passed = {line[6:22].strip() for line in lines if line.startswith("pass")}
    assert {"can0 up", "can0 queue", "can0 errors", "priority", "locked memory"} <= passed, lines
    failed = [i for i, line in enumerate(lines) if line.startswith("FAIL")]
    assert all(lines[i + 1].lstrip().startswith("-> ") for i in failed), lines


def test_the_store_is_shared_by_the_panel_the_controller_and_root(machine: Machine) -> None:
    token = directrix("tokens", "add", "script", "--state", str(STATE)).split()[-1]  # while the panel runs
    headers = {"Authorization": f"Bearer {token}"}
    with httpx.Client(base_url=API, headers=headers, timeout=services.HANGS_S) as panel:
        files = {"file": ("dry.ngc", b"G21 G90 G54 G0 X5.\nM30\n")}
        assert panel.post("/programs", files=files).status_code == 201
        until(
            lambda: (
                panel.get("/programs/dry.ngc").json()["check"]["state"] not in ("none", "waiting", "running")
            )
        )
        assert panel.get("/programs/dry.ngc").json()["check"]["state"] == "passed"
        assert panel.get("/status").json()["mode"] == "OFF"
        assert (
            panel.get("http://127.0.0.1:8080/").status_code < 500
        )  # the page's packages live in the sandbox
    machine.ask("load", path=str(next((STATE / "panel" / "programs").glob("*.ngc"))), name="dry.ngc")
    until(lambda: (machine.status().get("job") or {}).get("state") == "loaded", machine.status)
    machine.ask("unload")
    assert [path for path in services.unreadable_for_the_panel() if "journal" not in path] == []


def test_a_user_logs_in_with_a_password_and_uploads(machine: Machine) -> None:
    """Argon2 and the upload's folder are there inside the panel's sandbox, too."""
    name, password, state = "anna", "correct horse battery", ("--state", str(STATE))
    files = {"file": ("anna.ngc", b"G21 G90 G54 G0 X5.\nM30\n")}
    directrix("users", "add", name, *state, input=f"{password}\n")
    try:
        with httpx.Client(base_url=API, timeout=services.HANGS_S) as panel:
            until(lambda: panel.get("/programs").status_code == 401)  # it looks for users now and then
            assert panel.post("/programs", files=files).status_code == 401
            wrong = panel.post("/session", json={"name": name, "password": password[1:]})
            assert wrong.status_code == 401
            right = panel.post("/session", json={"name": name, "password": password})
            assert right.status_code == 200, right.text
            csrf = {"X-CSRF-Token": right.json()["csrf"]}
            assert panel.post("/programs", files=files).status_code == 403
            assert panel.post("/programs", files=files, headers=csrf).status_code == 201
    finally:
        directrix("users", "remove", name, *state)


@pytest.mark.parametrize("whom", ["main", "all"])
def test_a_killed_controller_tells_the_drives_to_stop_and_comes_back_switched_off(
    machine: Machine, whom: str
) -> None:
    with Witness() as witness:
        machine.moving()
        before = shown("MainPID")
        run("systemctl", "kill", "-s", "KILL", f"--kill-who={whom}", SERVICE)
        until(lambda: active() and shown("MainPID") not in (before, "0"), services.told)
        assert restarts() == 1
        assert machine.off()
        witness.forget()
        assert witness.stands(machine)
    assert "Told to stop: bus can0." in services.told()
    assert machine.ask("status")["not_homed"]


def test_a_killed_tick_leaves_standing_drives_and_is_back_after_a_reset(machine: Machine) -> None:
    with Witness() as witness:
        machine.moving()
        os.kill(services.pid_of("directrix-tick"), signal.SIGKILL)
        until(lambda: not machine.status().get("tick_alive", True) or restarts(), machine.status)
        until(machine.back_to_off, machine.status)
        assert machine.off()
        witness.forget()
        assert witness.stands(machine)
    assert "CONTROLLER_GONE" in machine.alarms()


def test_a_killed_plan_stops_the_tick_on_the_path_and_is_followed_by_another(machine: Machine) -> None:
    services.undisturbed(machine, lambda: _stops_on_the_path_without_plan(machine), "PLANNER_GONE")
    assert restarts() == 0


def _stops_on_the_path_without_plan(machine: Machine) -> None:
    with Witness() as witness:
        machine.moving()
        before = services.pid_of("directrix-plan")
        os.kill(before, signal.SIGKILL)
        until(lambda: machine.status().get("at_rest"), machine.status)
        until(lambda: services.pid_of("directrix-plan") not in (0, before), services.told)
        assert machine.ask("status")["fault"]["name"] == "PLANNER_GONE", machine.status()
        witness.forget()
        assert witness.on_the_path(), machine.status()
    assert not machine.ask("status")["not_homed"]


def test_a_killed_panel_stops_nothing_and_comes_back(machine: Machine) -> None:
    services.undisturbed(machine, lambda: _goes_on_without_panel(machine))


def _goes_on_without_panel(machine: Machine) -> None:
    machine.moving()
    controller, panel, before = shown("MainPID"), shown("MainPID", PANEL), restarts(PANEL)
    run("systemctl", "kill", "-s", "KILL", PANEL)
    until(lambda: not os.path.exists(f"/proc/{panel}"))
    last = machine.ask("status")["tick"]["number"]
    status = until(lambda: (now := machine.ask("status"))["tick"]["number"] > last + 30 and now)
    until(lambda: active(PANEL) and shown("MainPID", PANEL) not in (panel, "0") and services.panel_answers())
    assert (shown("MainPID"), restarts(), restarts(PANEL)) == (controller, 0, before + 1)
    assert status["mode"] in ("RUNNING", "READY"), status  # on its way still, or at the end of it


def test_a_tick_that_hangs_starves_the_watchdog(machine: Machine) -> None:
    with Witness() as witness:
        machine.moving()
        os.kill(services.pid_of("directrix-tick"), signal.SIGSTOP)
        until(lambda: restarts() == 1, services.told)
        assert "watchdog timeout" in services.told().lower()
        assert machine.off()
        witness.forget()
        assert witness.stands(machine)


def test_a_restart_ends_on_the_path_and_comes_back_switched_off(machine: Machine) -> None:
    with Witness() as witness:
        machine.moving()
        before = shown("MainPID")
        run("systemctl", "restart", SERVICE)
        assert shown("MainPID") not in (before, "0")
        assert machine.off()
        witness.forget()
        assert witness.stands(machine)


def test_an_orderly_stop_leaves_the_drives_off_and_no_process(machine: Machine) -> None:
    with Witness() as witness:
        machine.moving()
        run("systemctl", "stop", TARGET)
        until(lambda: shown("ActiveState") == "inactive", services.told)
        assert shown("Result") == "success", services.told()
        assert witness.stray_mm() < Witness.ON_PATH_MM  # to rest by setpoints, and off only then
    assert services.drives_stand()
    assert not services.RUNTIME.exists()


def test_the_controller_waits_for_its_interface_and_goes_and_comes_with_it(machine: Machine) -> None:
    services.stop()
    run("ip", "link", "del", services.INTERFACE)
    device = f"sys-subsystem-net-devices-{services.INTERFACE}.device"
    until(lambda: not active(device))  # systemd hears of it a moment later
    run("systemctl", "start", "--no-block", TARGET)
    until(lambda: active(PANEL))  # it waits for nobody
    assert shown("ActiveState") == "inactive"
    assert SERVICE in run("systemctl", "list-jobs", "--no-pager")
    on_can.ip("link", "add", "dev", services.INTERFACE, "type", "vcan")
    with on_can.drives_when_up(services.INTERFACE):
        until(active, services.told)
        assert "UP" in on_can.ip("link", "show", services.INTERFACE)
        assert " qlen 128" in on_can.ip("link", "show", services.INTERFACE)
        run("ip", "link", "del", services.INTERFACE)
        until(lambda: shown("ActiveState") == "inactive")
    on_can.ip("link", "add", "dev", services.INTERFACE, "type", "vcan")
    with on_can.drives_when_up(services.INTERFACE):
        until(active, services.told)
        services.stop()
