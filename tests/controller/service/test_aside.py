"""Hold, look, change the tool, go on: the service's side of it, with a machine that runs."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.live.served_machine import Serving, calm, serving
from support.machines.stepped_runs import program

from controller import messages

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]

TEXT = program("example2_ready.ngc", "1000.").replace("S12000 M3", "").replace("N220 M5\n", "")
SAME = 1e-6  # mm or degrees


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    folder = tmp_path_factory.mktemp("aside")
    with serving(folder, *calm(folder)) as running:
        running.ready()
        running.put_in(2)
        yield running


def held_in(service: Serving, share: float) -> dict[str, float]:
    """The joints where the program is held."""
    service.load(TEXT)
    service.done("start")
    service.until(lambda now: (now["job"]["fraction"] or 0.0) > share and now["mode"] == "RUNNING")
    service.ask("hold")
    return joints(service)


def joints(service: Serving) -> dict[str, float]:
    now = service.until(lambda now: now["mode"] == "HOLD" and now["at_rest"])
    return {name: axis["machine"] for name, axis in now["joints"].items()}


def go_on(service: Serving) -> None:
    service.ask("resume")
    assert service.ended()["job"]["state"] == "completed"


def test_off_along_the_tool_axis_jogged_and_back_to_beside_the_path(service: Serving) -> None:
    held = held_in(service, 0.4)
    service.done("retract", mm=10.0)
    assert service.status()["aside"] and service.status()["job"]["state"] == "held"
    error = service.refused("resume")
    assert (error.mode, error.request) == ("HOLD", "RESUME") and "let it return first" in error.sentence
    off = joints(service)
    service.ask("jog_step", frame="joint", axis="X", distance=12.0)
    service.until(lambda now: abs(now["joints"]["X"]["machine"] - off["X"] - 12.0) < SAME)
    joints(service)
    assert service.refused("resume").mode == "HOLD"
    service.done("return")
    waits = joints(service)
    assert not service.status()["aside"] and waits != pytest.approx(held, abs=0.5), "off the part"
    go_on(service)


def test_a_retract_has_the_room_that_the_travel_leaves(service: Serving) -> None:
    held_in(service, 0.3)
    room = service.status()["retract_room_mm"]
    assert f"up to {room:.3f} mm" in service.refused("retract", mm=1000.0).sentence
    assert service.refused("retract", mm=-1.0).code == "bad"
    assert "has not left the path" in service.refused("return").sentence
    go_on(service)


def test_a_longer_tool_goes_on_where_the_old_one_stopped(service: Serving) -> None:
    held = held_in(service, 0.4)
    tool = {"name": "another", "radius_mm": 1.4, "length_mm": 8.0, "flute_mm": 15.0}
    assert service.refused("set_tool", number=2, **tool).mode == "HOLD", "it stands on the path"
    service.done("retract", mm=20.0)
    service.ask("set_tool", number=2, **tool)
    service.done("return")
    back = joints(service)
    assert back != pytest.approx(held, abs=0.01), "the tip is where it was, not the axes"
    assert back["Z"] > held["Z"] + 5.0
    go_on(service)
    service.ask("set_tool", number=2, name="end mill", radius_mm=1.5, length_mm=0.0, flute_mm=15.0)


def test_a_stop_off_the_path_ends_the_program_and_the_rest_is_offered(service: Serving) -> None:
    held_in(service, 0.5)
    service.done("retract", mm=5.0)
    service.ask("stop")
    assert service.ended()["job"]["state"] == "stopped"
    assert not service.status()["aside"]
    path = str(service.state / "part.ngc")
    service.done("load", path=path, name="part.ngc", restart=True)
    assert any(line["key"] == "at.entry" for line in service.status()["job"]["restart"])


def test_after_a_fault_in_a_cut_the_remedy_can_be_followed(service: Serving) -> None:
    """Reset, enable, retract along the tool axis; tables carry the rotaries, so that is Z."""
    held_in(service, 0.4)
    service.ask("resume")
    service.ask("estop")
    service.until(lambda now: now["mode"] == "FAULT" and now["at_rest"])
    assert service.refused("retract", mm=5.0).mode == "FAULT"
    service.done("reset")
    service.done("enable")
    stood = {name: axis["machine"] for name, axis in service.status()["joints"].items()}
    service.done("retract", mm=15.0)
    now = {name: axis["machine"] for name, axis in service.status()["joints"].items()}
    assert now == pytest.approx(stood | {"Z": stood["Z"] + 15.0}, abs=SAME)
    assert not service.status()["aside"], "no program is held"
    assert service.refused("return").mode == "READY"
    service.load(TEXT)
    service.done("start")
    assert service.ended()["job"]["state"] == "completed"


def test_a_plan_killed_while_the_tool_stands_aside_is_a_fault_with_one_alarm_and_nothing_moves(
    service: Serving,
) -> None:
    held_in(service, 0.4)
    service.done("retract", mm=5.0)
    off, old = joints(service), service.pid("plan")
    before = len(service.ask("alarms")["alarms"])
    service.kill("plan")
    now = service.until(lambda now: now["mode"] == "FAULT" and service.pid("plan") != old)
    assert {name: axis["machine"] for name, axis in now["joints"].items()} == off
    assert now["fault"]["name"] == "PLANNER_GONE" and now["fault"]["position_trusted"]
    now = service.ended()
    assert now["job"]["state"] == "fault" and "planner" in messages.text(now["job"])
    assert len(service.ask("alarms")["alarms"]) == before + 1
    service.until(lambda now: now["plan_alive"])
    service.done("reset")
    service.done("enable")
    service.done("retract", mm=5.0)
    service.load(TEXT)
    service.done("start")
    assert service.ended()["job"]["state"] == "completed"
