"""What programs set for good: at its line, not before, on disk, and again after a loss of power."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.live.served_machine import Serving, Values, calm, serving

from controller import own_database
from controller.store import service_store, set_up_store

pytestmark = [pytest.mark.slow, pytest.mark.live, pytest.mark.calm]

WAITS = """G21 G90 G54
G1 X40. F2000
G10 L2 P3 X5. Y6. Z7. C30
G1 X20.
M0
G10 L2 P3 X9.
#500=[#500+1]
G1 X0
M30
"""


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Serving]:
    with serving(tmp_path, *options(tmp_path)) as running:
        running.ready()
        yield running


def options(folder: Path) -> tuple[str, str]:
    """A machine that keeps #500."""
    made = calm(folder)
    file = Path(made[1])
    text = file.read_text()
    if "kept_parameters" not in text:
        file.write_text(text.replace("[machine]\n", "[machine]\nkept_parameters = [500]\n", 1))
    return made


def fitted(service: Serving) -> Values:
    return set_up_store.load(service.state)


def probed_on_disk(service: Serving) -> bool:
    with own_database.reading(service.state / service_store.FILE) as sql:
        return sql.execute("SELECT 1 FROM documents WHERE name = 'probed'").fetchone() is not None


def offset(service: Serving, name: str = "G56") -> Values:
    return dict(service.ask("facts")["offsets"][name])


def test_an_offset_is_set_at_its_line_and_outlives_the_service(service: Serving, tmp_path: Path) -> None:
    service.load(WAITS)
    assert offset(service)["unset"] and not fitted(service)  # a check sets nothing
    service.done("start")
    service.until(lambda now: now["mode"] == "RUNNING" and now["job"]["line"] == 2, "line 2")
    assert offset(service)["unset"]
    service.until(lambda now: now["mode"] == "HOLD" and now["job"]["line"] == 5, "M0")
    service.until(lambda _: not offset(service)["unset"], "the offset")
    now = offset(service)
    assert (now["origin_mm"], now["source"]) == ([5.0, 6.0, 7.0], "machine")
    assert now["rotary_deg"]["C"] == pytest.approx(30.0)
    assert fitted(service)["offsets"]["G56"]["origin_mm"] == [5.0, 6.0, 7.0]
    assert "parameters" not in fitted(service)
    service.ask("resume")
    assert service.ended()["job"]["state"] == "completed"
    assert offset(service)["origin_mm"] == [9.0, 6.0, 7.0]
    assert fitted(service)["parameters"] == {"500": 1.0}
    service.done("mdi", text="G92 X1. C10")
    service.ended()
    service.done("mdi", text="G10 L1 P2 Z12.5 R1.4")
    service.ended()
    service.done("mdi", text="(LOG, mine way_mm=#5420)\nG4 P0.01")
    service.ended()
    service.until(lambda _: probed_on_disk(service), "what was found on the disk")
    service.process.kill()  # as a loss of power
    service.process.wait()
    with serving(tmp_path, *options(tmp_path)) as again:
        again.ready()
        facts = again.ask("facts")
        assert again.ask("probed")["found"][0]["values"] == {"way_mm": 1.0}
        assert facts["offsets"]["G56"]["origin_mm"] == [9.0, 6.0, 7.0]
        assert facts["shift"]["source"] == "machine" and not facts["shift"]["suspended"]
        tool = next(row for row in facts["tools"] if row["number"] == 2)
        assert (tool["length_mm"], tool["radius_mm"], tool["source"]) == (12.5, 1.4, "machine")
        assert facts["parameters"] == {"#500": 1.0}
        assert again.status()["joints"]["X"]["work"] == pytest.approx(-7.0)
        assert again.status()["joints"]["C"]["work"] == pytest.approx(10.0)
        again.load(WAITS)
        again.done("start")
        again.until(lambda now: now["mode"] == "HOLD", "M0")
        again.ask("resume")
        again.ended()
        assert again.ask("facts")["parameters"] == {"#500": 2.0}


def test_a_stop_before_the_line_leaves_it_unset_and_one_can_go_back(service: Serving) -> None:
    service.load(WAITS)
    service.done("start")
    service.until(lambda now: now["mode"] == "RUNNING" and now["joints"]["X"]["work"] > 1.0, "line 2")
    service.ask("stop")
    assert service.ended()["job"]["state"] == "stopped"
    assert offset(service)["unset"] and "offsets" not in fitted(service)
    service.load(WAITS.replace("M0\n", "M30\n"))
    service.done("start")
    service.ended()
    before = offset(service, "G54")
    service.ask("set_offset", name="G54", values={"origin_mm": [1.0, 2.0, 3.0]})
    assert offset(service, "G54")["source"] == "machine"
    service.ask("forget", name="G54")
    assert offset(service, "G54") == before and before["source"] == "file"
    assert not offset(service)["unset"]
    service.ask("forget", name="all")
    assert offset(service)["unset"] and fitted(service) == {}
    assert "G54" in service.refused("forget", name="G54").sentence


def test_what_was_interrupted_behind_a_setting_goes_on_with_it(service: Serving) -> None:
    """Its own lines changed the offsets since: that is no reason to refuse it, and nothing counts twice."""
    text = "G21 G90 G54\nG1 X40. F3000\nG10 L20 P1 X0\n#500=[#500+1]\nG1 X20.\nG1 X-20. F300\nM30\n"
    service.load(text)
    service.done("start")
    service.until(lambda now: now["job"]["line"] == 6 and now["mode"] == "RUNNING", "line 6")
    service.ask("hold")
    held = service.until(lambda now: now["mode"] == "HOLD" and now["feed_mm_min"]["actual"] == 0.0, "hold")
    service.ask("stop")
    service.ended()
    shifted = offset(service, "G54")["origin_mm"]
    assert shifted[0] == pytest.approx(48.0)
    path = service.state / "part.ngc"
    service.done("load", path=str(path), name="part.ngc", restart=True)
    service.done("start")
    service.ended()
    assert offset(service, "G54")["origin_mm"] == shifted
    assert service.ask("facts")["parameters"] == {"#500": 1.0}
    assert service.status()["joints"]["X"]["machine"] == pytest.approx(28.0)
    assert held["joints"]["X"]["machine"] > 28.0
