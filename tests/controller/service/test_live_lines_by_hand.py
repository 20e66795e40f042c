"""Lines typed by hand on a served machine: each goes on from where the one before has left the control."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.live.replayed_runs import again, assert_same_setpoints, facts, records
from support.live.served_machine import ROOT, Serving, serving

from controller.machine import machine_file

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Serving]:
    """A machine with spindle, coolant and lengths; its programs begin with the state that is in force."""
    text = (ROOT / "config" / "machining_centre.toml").read_text()
    file = tmp_path / "keeps.toml"
    file.write_text(text.replace("[machine]\n", '[machine]\nstart_state = "keep"\n', 1))
    (tmp_path / "tools.toml").write_text((ROOT / "config" / "tools.toml").read_text())
    with serving(tmp_path, "--machine", str(file)) as running:
        running.up()
        if running.status()["changer"]["doubt"]:
            running.ask("changer_confirm", spindle=1, away=[], clear=True)
        running.home()
        yield running


def typed(service: Serving, text: str) -> tuple[float, set[str]]:
    """X of the machine after a line, and the codes in force."""
    service.done("mdi", text=text)
    now = service.ended()
    return round(now["joints"]["X"]["machine"], 6), set(now["codes"])


def test_a_line_goes_on_from_the_one_before(service: Serving) -> None:
    begin, codes = typed(service, "G91")
    assert "G91" in codes
    assert typed(service, "G0 X3")[0] == begin + 3.0
    assert typed(service, "X1")[0] == begin + 4.0
    _, codes = typed(service, "M3 S1000")
    assert {"M3", "S1000", "M9"} <= codes
    _, codes = typed(service, "M8")
    assert {"M3", "M8"} <= codes
    there, codes = typed(service, "X-1")
    now = service.status()
    assert there == begin + 3.0 and now["spindle"]["rev_min"] == 1000.0 and now["coolant"]["flood"]
    service.load("G1 X1 F600\nM0\nM30\n")  # G91, and the spindle turns, as it is
    service.done("start")
    held = service.until(lambda one: one["mode"] == "HOLD", "M0")
    assert held["spindle"]["rev_min"] == 1000.0 and {"G91", "F600", "M8"} <= set(held["codes"])
    service.ask("resume")
    now = service.ended()
    assert round(now["joints"]["X"]["machine"], 6) == begin + 4.0
    now = service.until(lambda one: one["spindle"]["rev_min"] == 0.0, "the spindle's stop")
    assert {"G90", "M5", "M9", "F0"} <= set(now["codes"]), "M30"


def test_the_hand_and_the_line_turn_the_same_spindle(service: Serving) -> None:
    service.ask("spindle", rev_min=800.0)
    _, codes = typed(service, "G91 G0 X1")
    assert {"M3", "S800"} <= codes and service.status()["spindle"]["rev_min"] == 800.0
    service.ask("mdi", text="G1 X50 F60")
    service.until(lambda one: one["mode"] == "RUNNING" and not one["at_rest"], "motion")
    service.ask("stop")
    service.ended()
    now = service.until(lambda one: one["spindle"]["rev_min"] == 0.0, "the spindle's stop")
    assert {"G91", "G1", "M5", "F60"} <= set(now["codes"])


def test_a_line_in_a_record_is_run_again_as_it_was(service: Serving) -> None:
    typed(service, "G91 G43 H2 F300")
    typed(service, "G1 X2 Z-3")
    service.until(lambda _: len(records(service.state)) == 2, "the records")
    machine = machine_file.load(service.state.parent / "keeps.toml")
    for folder, line in zip(records(service.state), ("G91 G43 H2 F300", "G1 X2 Z-3"), strict=True):
        assert facts(folder)["result"] == "completed"
        assert_same_setpoints(again(folder, line, machine))


def test_a_program_that_is_gone_on_with_begins_in_the_state_in_which_it_began(service: Serving) -> None:
    """After a loss of power nothing else knows in which offset, or at which length, it ran."""
    typed(service, "G91 G43 H2 F300")
    service.load("G1 X20\nX-20\nX20\nM30\n")
    service.done("start")
    service.until(lambda one: one["mode"] == "RUNNING" and one["job"]["line"] == 2, "line 2")
    service.ask("stop")
    service.ended()
    typed(service, "G90 G49")
    service.done("load", path=str(service.state / "part.ngc"), name="part.ngc", restart=True)
    service.done("start")
    now = service.until(lambda one: one["job"]["state"] == "running" and not one["at_rest"], "motion")
    now = service.until(lambda one: one["job"]["line"] == 3, "line 3")
    assert {"G91", "G43", "H2"} <= set(now["codes"])
    assert service.ended()["job"]["state"] == "completed"
