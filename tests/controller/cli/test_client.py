"""The client verbs against the panel's own application; the machine behind it only notes what it is asked."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import json
import sqlite3
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from rich.console import Console
from support.fakes.fake_socket import PROBED, tools_of
from support.fakes.noting_door import NotingDoor
from support.fakes.written_history import WrittenHistory
from typer.testing import CliRunner, Result

from controller import sealed_file
from controller.__main__ import app
from controller.api.answers import Refusal
from controller.api.app_state import Panel
from controller.api.service_client import Watch
from controller.api.users import new_token
from controller.cli import client as verbs
from controller.cli import client_lists, remote
from controller.ipc.asker import asker
from controller.ipc.control_socket import LAST
from controller.machine import machine_file
from controller.messages import plain
from controller.service import runs
from controller.state.modes import Fault, fault_message
from controller.store.service_store import ServiceStore

ASK = CliRunner()
PROGRAM = b"g90\ng0 x1\nm30\n"
DEAD = "http://127.0.0.1:9"  # discard: nobody listens there


def run(*words: str, answer: str = "") -> Result:
    return ASK.invoke(app, list(words), input=answer)


def done(*words: str) -> str:
    ran = run(*words)
    assert ran.exit_code == 0, ran.output + ran.stderr
    return ran.stdout


@pytest.fixture
def program(tmp_path: Path) -> Path:
    file = tmp_path / "part.ngc"
    file.write_bytes(PROGRAM)
    return file


@pytest.mark.parametrize("verb", ["hold", "stop"])
def test_a_hold_of_what_was_only_being_prepared_says_so(panel: Panel, door: NotingDoor, verb: str) -> None:
    door.results[verb] = {"outcome": "given_up", "what": "start", "mode": "READY", "tick": 7}
    assert done(verb).strip() == "Given up before it began: start."
    assert json.loads(done(verb, "--json"))["result"]["outcome"] == "given_up"


REQUESTS = [
    (("hold",), "hold", {}),
    (("stop",), "stop", {}),
    (("estop",), "estop", {}),
    (("resume",), "resume", {}),
    (("reset",), "reset", {}),
    (("enable",), "enable", {}),
    (("disable",), "disable", {}),
    (("start",), "start", {}),
    (("start", "--unrecorded"), "start", {"unrecorded": True, "worn": False}),
    (("home",), "home", {"axes": None}),
    (("home", "x", "C"), "home", {"axes": ["X", "C"]}),
    (("mdi", "G0 Z50"), "mdi", {"text": "G0 Z50", "still": False}),
    (("mdi", "G91", "--still"), "mdi", {"text": "G91", "still": True}),
    (("macro", "Warm up"), "macro", {"name": "Warm up", "still": False, "role": "set_up"}),
    (
        ("probe", "edge", "towards=X-", "most=7.5", "--offset", "G54"),
        "probe",
        {"cycle": "edge", "values": {"towards": "X-", "most": 7.5}, "offset": "G54"},
    ),
    (("override", "80"), "override", {"share": 0.8}),
    (("override", "25", "--rapid"), "rapid_override", {"share": 0.25}),
    (("adaptive", "on"), "adaptive_feed", {"on": True}),
    (("adaptive", "off"), "adaptive_feed", {"on": False}),
    (("override", "90", "--spindle"), "spindle_override", {"share": 0.9}),
    (("spindle", "-3000"), "spindle", {"rev_min": -3000.0}),
    (("spindle", "0"), "spindle", {"rev_min": 0.0}),
    (("coolant", "--flood"), "coolant", {"mist": False, "flood": True}),
    (("clamps", "a"), "clamps", {"open": ["A"]}),
    (("clamps",), "clamps", {"open": []}),
    (("retract", "20"), "retract", {"mm": 20.0}),
    (("return",), "return", {}),
    (("jog", "x", "-10"), "jog_step", {"frame": "joint", "axis": "X", "distance": -10.0, "feed": None}),
    (
        ("jog", "Z", "0.5", "--frame", "tool"),
        "jog_step",
        {"frame": "tool", "axis": "Z", "distance": 0.5, "feed": None},
    ),
]


@pytest.mark.parametrize(("words", "verb", "args"), REQUESTS)
def test_a_verb_asks_the_machine_for_just_that_and_tells_it_as_json_too(
    words: tuple[str, ...], verb: str, args: dict[str, Any], panel: Panel, door: NotingDoor
) -> None:
    assert done(*words)
    assert [(v, a) for v, a in door.asked if v != "jog_stop"] == [(verb, args)]
    assert panel.control.holder == "", "control is given back"
    told = json.loads(done(*words, "--json"))
    assert told["ok"] is True and told["request"] == verb


def test_the_probing_cycles_are_listed_with_their_values(panel: Panel, door: NotingDoor) -> None:
    told = done("probe")
    assert "edge: Edge\n    towards=X+  Towards (X+|X-|Y+|Y-)\n    most=20.0  Touches within (0.1" in told
    assert "edge: Kante\n    towards=X+  Richtung" in done("probe", "--language", "de")
    assert json.loads(done("probe", "--json"))["cycles"][0]["name"] == "top"
    ran = run("probe", "edge", "most")
    assert ran.exit_code == 1 and "as most=20" in ran.stderr and not door.verbs


def test_the_life_of_a_tool_is_shown_set_and_renewed(panel: Panel, door: NotingDoor) -> None:
    door.results["facts"] = {"tools": [tools_of(machine_file.load("trunnion"))[1]]}
    use = {"number": 2, "cut_s": 90.0, "cut_m": 12.5, "parts": 3, "since_s": None, "most_cut_min": 60.0}
    use |= {"most_cut_m": None, "most_parts": 40, "sister": 3, "worn": True}
    for verb in ("usage", "tool_life", "tool_renewed"):
        door.results[verb] = {"tools": [use], "counters": [], "items": []}
    told = [[cell.strip() for cell in line.split("│")[1:-1]] for line in done("tools").splitlines()]
    assert ["T2", "1.5 / 60", "12.5", "3 / 40", "T3", "worn"] in told
    assert "verschlissen" in done("tools", "--language", "de")
    done("tools", "--life", "2", "--parts", "0", "--sister", "12")
    limits = {"tool": 2, "cut_min": 60.0, "cut_m": None, "parts": None, "sister": 12}
    assert ("tool_life", limits) in door.asked
    row = json.loads(done("tools", "--renewed", "2", "--json"))["tools"][0]
    assert row["number"] == 2 and row["life"]["worn"] is True
    assert ("tool_renewed", {"tool": 2}) in door.asked
    assert run("tools", "--minutes", "5").exit_code == 2


def test_the_touches_of_the_probe_are_written_as_a_table(panel: Panel, tmp_path: Path) -> None:
    ran = run("probe", "--touches", str(tmp_path / "t.csv"))
    assert ran.exit_code == 1 and "probe first" in ran.stderr
    kept = "line,touched,X,Y,Z\n5,1,8.0,96.0,212.699\n"
    with contextlib.closing(ServiceStore(panel.store.folder)) as store:
        store.put("touches", kept.splitlines())
    assert "1 touches written" in done("probe", "--touches", str(tmp_path / "t.csv"))
    assert (tmp_path / "t.csv").read_text() == kept
    with contextlib.closing(sqlite3.connect(store.file)) as sql:  # which keeps no sums, as a bad bit
        sql.execute("UPDATE documents SET value = replace(value, '8.0', '9.0')")
        sql.commit()
    ran = run("probe", "--touches", str(tmp_path / "t.csv"))
    assert ran.exit_code == 1 and "documents 2" in ran.stderr  # a new one stands there twice


def test_jobs_of_maintenance_are_listed_made_and_done(panel: Panel, door: NotingDoor) -> None:
    job = {"name": "grease", "counter": "X", "every": 5.0, "used": 6.5, "unit": "m", "done_s": None}
    told = {"tools": [], "counters": [{"name": "X", "value": 12.0, "unit": "m"}]}
    told["counters"].append({"name": "motion", "value": 3.5, "unit": "h"})
    told |= {"items": [{**job, "done_by": "", "due": True}]}
    for verb in ("usage", "maintenance", "maintained"):
        door.results[verb] = told
    assert "due" in done("maintenance") and "fällig" in done("maintenance", "--language", "de")
    assert "In Bewegung (motion)" in done("maintenance", "--language", "de").replace("\n", " ")
    done("maintenance", "grease", "--counter", "X", "--every", "5")
    assert ("maintenance", {"name": "grease", "counter": "X", "every": 5.0}) in door.asked
    done("maintenance", "grease", "--every", "0")
    assert ("maintenance", {"name": "grease", "counter": "", "every": None}) in door.asked
    items = json.loads(done("maintenance", "grease", "--done", "--json"))["items"]
    assert items[0]["due"] is True and "maintained" in door.verbs
    assert run("maintenance", "--done").exit_code == 2


def test_a_tool_is_made_changed_and_taken_out(panel: Panel, door: NotingDoor) -> None:
    row = tools_of(machine_file.load("trunnion"))[1]
    door.results["facts"] = {"tools": [row]}
    door.results["usage"] = {"tools": [], "counters": [], "items": []}
    done("tools", "--set", "2", "wear_length_mm=-0.02")
    kept = {key: row[key] for key in ("name", "radius_mm", "length_mm", "flute_mm")}
    assert ("set_tool", {"number": 2, **kept, "wear_length_mm": -0.02}) in door.asked
    done("tools", "--set", "9", "radius_mm=2.5", "length_mm=40", "flute_mm=12", "name=7")
    made = {"number": 9, "name": "7", "radius_mm": 2.5, "length_mm": 40.0, "flute_mm": 12.0}
    assert ("set_tool", made) in door.asked
    done("tools", "--set", "2", "centre_cutting=false")
    assert ("set_tool", {"number": 2, **kept, "centre_cutting": False}) in door.asked
    done("tools", "--delete", "9")
    assert ("set_tool", {"number": 9, "remove": True}) in door.asked
    for words, why in ((("radius_mm=2",), "--set"), (("--set", "2", "radius_mm"), "as most=20")):
        ran = run("tools", *words)
        assert ran.exit_code and why in ran.stderr


@pytest.mark.parametrize("ending", [".tbl", ".json"])
def test_a_table_that_was_written_is_taken_in_with_its_wear_laid_in(
    panel: Panel, door: NotingDoor, tmp_path: Path, ending: str
) -> None:
    row = {**tools_of(machine_file.load("trunnion"))[1], "length_mm": 50.0, "wear_length_mm": -0.05}
    door.results["facts"] = {"tools": [row]}
    door.results["usage"] = {"tools": [], "counters": [], "items": []}
    file = tmp_path / f"own{ending}"
    done("tools", "--export", str(file))
    assert file.read_text() == panel_text(panel, ending)
    done("tools", "--import", str(file))
    (taken,) = [args for verb, args in door.asked if verb == "set_tool"]
    assert taken["length_mm"] == pytest.approx(row["length_mm"] - 0.05) and taken["wear_length_mm"] == 0.0
    file.write_text("T2 P2 D6\nfoo")
    ran = run("tools", "--import", str(file), "--language", "de")
    assert ran.exit_code == 1 and ("Zeile" if ending == ".tbl" else "JSON") in ran.stderr
    assert len([verb for verb in door.verbs if verb == "set_tool"]) == 1


def panel_text(panel: Panel, ending: str) -> str:
    with remote.client("", {}) as http:
        answer = http.get(f"/api/v1/tools{ending}")
    assert answer.status_code == 200
    return answer.text


def test_an_offset_is_set_and_touched_off(panel: Panel, door: NotingDoor) -> None:
    g55 = {"origin_mm": [1.0, 2.0, 3.0], "axes": None, "unset": False, "source": "machine"}
    nowhere = {"origin_mm": [0.0] * 3, "rotary_deg": {}, "suspended": False, "source": "file"}
    door.results["facts"] = {
        "offsets": {"G55": g55},
        "shift": nowhere,
        "tools": [],
    }
    done("offsets", "G55", "--origin", "4,5,-6", "--rotary", "C=15")
    wanted = {"origin_mm": [4.0, 5.0, -6.0], "turned_deg": [0.0, 0.0, 0.0], "rotary_deg": {"C": 15.0}}
    assert ("set_offset", {"name": "G55", "values": wanted}) in door.asked
    done("offsets", "G55", "--turned", "0,0,30")
    turned = {"origin_mm": [1.0, 2.0, 3.0], "turned_deg": [0.0, 0.0, 30.0]}
    assert ("set_offset", {"name": "G55", "values": turned}) in door.asked
    done("offsets", "G55", "--touch", "z=5/2", "--touch", "C=+0.1", "--tool", "3")
    reads = {"Z": "5/2", "C": "+0.1"}
    assert ("set_offset", {"name": "G55", "reads": reads, "tool": 3}) in door.asked
    door.results["usage"] = {"tools": [], "counters": [], "items": []}
    done("tools", "--set", "3", "--touch", "z=2")
    assert ("set_tool", {"number": 3, "reads": {"Z": "2"}}) in door.asked
    for words, why in (
        (("--origin", "1,2,3"), "name it first"),
        (("--forget", ""), "needs what is to be forgotten"),
        (("G55",), "nothing is said"),
        (("G55", "--origin", "1,2"), "three numbers"),
        (("G55", "--rotary", "C=low"), "write it as C=15"),
    ):
        ran = run("offsets", *words)
        assert ran.exit_code and why in " ".join(ran.stderr.replace("│", " ").split())


def test_what_cycles_have_found_is_listed_and_written_as_a_table(
    panel: Panel, door: NotingDoor, tmp_path: Path
) -> None:
    door.results["probed"] = {"found": []}
    assert done("probe", "--found") == "No cycle has found anything yet.\n"
    door.results["probed"] = {"found": PROBED}
    assert "part.ngc bore x_mm=12.5 y_mm=-3.25 diameter_mm=20.01\n" in done("probe", "--found")
    assert json.loads(done("probe", "--found", "--json"))["found"][1]["values"]["angle_deg"] == -0.5
    file = tmp_path / "found.csv"
    assert done("probe", "--csv", str(file)).startswith("5 values written to")
    rows = list(csv.reader(file.open(newline="")))
    assert rows[0] == ["time", "program", "cycle", "value", "unit", "number"]
    assert rows[1] == ["2027-01-15T08:00:00+00:00", "part.ngc", "bore", "x", "mm", "12.5"]
    assert rows[-1][2:] == ["mine", "angle", "deg", "-0.5"] and len(rows) == 6
    assert run("probe", "--csv", str(tmp_path / "no" / "file.csv")).exit_code == 1


def test_hold_stop_and_estop_pass_whoever_holds_control(panel: Panel, door: NotingDoor) -> None:
    panel.control.holder, panel.control._token = "page", "secret"
    for verb in ("hold", "stop", "estop"):
        done(verb)
    assert door.verbs == ["hold", "stop", "estop"] and panel.control.holder == "page"


def test_who_holds_control_is_named_and_can_be_taken_over(panel: Panel, door: NotingDoor) -> None:
    panel.control.holder, panel.control._token = "page", "secret"
    ran = run("start")
    assert ran.exit_code == 1 and ran.stderr.startswith("page holds control; ") and not door.verbs
    assert "--take-over" in ran.stderr
    done("start", "--take-over")
    assert door.verbs == ["start"]


def test_a_refusal_is_the_machines_own_sentence(panel: Panel, door: NotingDoor) -> None:
    sentence = "HOME is refused in RUNNING: the tool is in the work; stop first."
    door.refused["home"] = Refusal(409, "refused", sentence, mode="RUNNING", request="HOME")
    ran = run("home")
    assert ran.exit_code == 1 and ran.stderr.strip() == sentence
    told = json.loads(run("home", "--json").stdout)
    assert told == {
        "ok": False,
        "error": sentence,
        "status": 409,
        "code": "refused",
        "mode": "RUNNING",
        "request": "HOME",
    }
    assert panel.control.holder == "", "given back also after a refusal"


def test_what_takes_long_is_waited_for(panel: Panel, door: NotingDoor) -> None:
    door.results["home"] = {"done": False}
    door.coming = [{"state": "running"}, {"state": "done"}]
    assert done("home").strip() == "Homed." and door.coming == []


def test_what_fails_on_the_way_is_refused_with_its_sentence(panel: Panel, door: NotingDoor) -> None:
    door.results["home"] = {"done": False}
    door.coming = [{"state": "failed", "name": "home", "sentence": "C found no reference switch."}]
    ran = run("home")
    assert ran.exit_code == 1 and ran.stderr.strip() == "C found no reference switch."
    assert panel.control.holder == ""


JOB = {
    "name": "part.ngc",
    "state": "loaded",
    "sentence": None,
    "restart": [plain("Line 2, 0 % of its block.")],
}


def test_a_program_that_takes_long_to_read_is_waited_for_and_its_state_is_shown(
    panel: Panel, door: NotingDoor, program: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verbs, "POLL_S", 0.03)  # a status is shared for less
    done("upload", str(program))
    door.results["load"] = {"done": False}
    door.jobs = [{**JOB, "state": "loading"}, JOB]
    ran = run("start", "part.ngc", "--line", "2", answer="n\n")
    assert ran.exit_code == 1 and "Line 2, 0 % of its block." in ran.stderr and door.verbs == ["load"]
    door.jobs = [{**JOB, "state": "refused", "sentence": "line 2: there is no such code."}]
    ran = run("start", "part.ngc")
    assert ran.exit_code == 1 and ran.stderr.strip() == "line 2: there is no such code."
    door.jobs = [{**JOB, "name": "other.ngc"}]
    ran = run("start", "part.ngc")
    assert ran.exit_code == 1 and "another program was loaded" in ran.stderr and "start" not in door.verbs


# --- programs


def test_a_program_is_uploaded_whole_and_started_by_name(
    panel: Panel, door: NotingDoor, program: Path
) -> None:
    assert done("upload", str(program)).startswith("part.ngc: stored")
    stored = panel.store.programs.get("part.ngc")
    assert panel.store.programs.path(stored.sha256).read_bytes() == PROGRAM
    assert door.asked == [], "an upload starts nothing"
    done("start", "part.ngc")
    assert door.verbs == ["load", "start"]
    assert door.asked[0][1]["sha256"] == stored.sha256


def test_a_program_may_have_another_name_in_the_store(panel: Panel, program: Path) -> None:
    done("upload", str(program), "--name", "bracket.ngc")
    assert [p.name for p in panel.store.programs.list()] == ["bracket.ngc"]


def test_a_file_that_is_not_there_is_refused_before_anything_is_sent(panel: Panel, tmp_path: Path) -> None:
    ran = run("upload", str(tmp_path / "no.ngc"))
    assert ran.exit_code == 1 and "there is no such file" in ran.stderr


def test_a_program_that_is_not_in_the_store_is_not_started(panel: Panel, door: NotingDoor) -> None:
    ran = run("start", "nobody.ngc")
    assert ran.exit_code == 1 and "nobody.ngc" in ran.stderr and door.verbs == []


def test_a_start_in_mid_program_shows_the_state_and_asks(
    panel: Panel, door: NotingDoor, program: Path
) -> None:
    done("upload", str(program))
    no = run("start", "part.ngc", "--line", "2", answer="n\n")
    assert no.exit_code == 1 and "Work offset G54." in no.stderr and door.verbs == ["load"]
    yes = run("start", "part.ngc", "--line", "2", "--fraction", "0.5", answer="y\n")
    assert yes.exit_code == 0 and door.verbs == ["load", "load", "start"]
    assert [args.get("fraction") for verb, args in door.asked if verb == "load"] == [None, 0.5]


def test_a_start_in_mid_program_by_a_script_must_say_yes(
    panel: Panel, door: NotingDoor, program: Path
) -> None:
    done("upload", str(program))
    ran = run("start", "part.ngc", "--line", "2", "--json")
    assert ran.exit_code == 1 and "--yes" in json.loads(ran.stdout)["error"] and door.verbs == []
    assert json.loads(done("start", "part.ngc", "--line", "2", "--yes", "--json"))["ok"]


OFFER = {"offered": True, "name": "part.ngc", "sha256": hashlib.sha256(PROGRAM).hexdigest(), "line": 2}


def test_what_was_interrupted_is_shown_and_gone_on_with(
    panel: Panel, door: NotingDoor, program: Path
) -> None:
    done("upload", str(program))
    door.results["restart"] = OFFER
    no = run("start", "--restart", answer="n\n")
    assert no.exit_code == 1 and "Work offset G54." in no.stderr and "start" not in door.verbs
    assert run("start", "--restart", answer="y\n").exit_code == 0
    assert [args.get("restart") for verb, args in door.asked if verb == "load"] == [True, True]
    assert door.verbs[-1] == "start"
    other = run("start", "other.ngc", "--restart")
    assert other.exit_code == 1 and "part.ngc was interrupted, not other.ngc" in other.stderr


def test_where_nothing_is_offered_the_reason_is_told_and_nothing_is_loaded(
    panel: Panel, door: NotingDoor
) -> None:
    door.results["restart"] = {"offered": False, "sentence": "Home all axes first."}
    ran = run("start", "--restart", "--yes", "--json")
    assert ran.exit_code == 1 and json.loads(ran.stdout)["error"] == "Home all axes first."
    assert "load" not in door.verbs and "start" not in door.verbs


def test_a_place_needs_a_program(panel: Panel, door: NotingDoor) -> None:
    ran = run("start", "--line", "5")
    assert ran.exit_code == 1 and "need the name of a program" in ran.stderr and door.asked == []


# --- jog


def test_a_continuous_jog_is_refreshed_and_stopped_at_its_end(panel: Panel, door: NotingDoor) -> None:
    done("jog", "X", "--speed", "-0.5", "--seconds", "0.3")
    jogs = [args for verb, args in door.asked if verb == "jog"]
    assert len(jogs) >= 2 and all(j["speed"] == -0.5 and j["axis"] == "X" for j in jogs)
    assert door.asked[-1][0] == "jog_stop"


def test_a_jog_that_ends_at_a_soft_limit_says_so_and_not_how_far_was_asked_for(
    panel: Panel, door: NotingDoor
) -> None:
    door.status["joints"] = {"X": {"limit": "+"}, "A": {"limit": None}}
    door.then["jog_step"] = lambda: door.status.update(joints={"X": {"limit": "+"}, "A": {"limit": "-"}})
    assert done("jog", "A", "-500") == "Moved A as far as the soft limit of A.\n"
    door.then["jog_step"] = lambda: None
    assert done("jog", "A", "1") == "Moved A by 1.\n"


def test_a_jog_that_is_broken_off_is_stopped(panel: Panel, door: NotingDoor) -> None:
    door.refused["jog"] = Refusal(409, "refused", "JOG is refused in RUNNING.")
    assert run("jog", "X", "--speed", "0.5", "--seconds", "60").exit_code == 1
    assert door.asked[-1][0] == "jog_stop"


@pytest.mark.parametrize(
    "words",
    [
        ("jog", "X"),
        ("jog", "X", "1", "--speed", "1"),
        ("jog", "X", "--speed", "1"),
        ("jog", "X", "1", "--seconds", "1"),
    ],
)
def test_a_jog_needs_a_distance_or_a_speed_with_its_time(
    words: tuple[str, ...], panel: Panel, door: NotingDoor
) -> None:
    assert run(*words).exit_code == 1 and door.asked == []


# --- what is looked at


def test_status_shows_the_machine_and_what_nobody_acknowledged(
    history: WrittenHistory, door: NotingDoor
) -> None:
    history.alarm("DOOR_OPEN", "The door is open.")
    told = done("status")
    assert "READY" in told and "The door is open." in told
    assert json.loads(done("status", "--json"))["mode"] == "READY"


def test_of_a_service_that_is_gone_the_last_is_shown_as_old_and_the_exit_code_says_so(
    panel: Panel, door: NotingDoor
) -> None:
    door.refused["status"] = Refusal(503, "gone", "The service does not answer.")
    assert "does not answer" in run("status").output, "nothing is known of it"
    job = {"name": "part.ngc", "line": 8, "state": "fault", "left_s": 50.0, "elapsed_s": 29.0}
    joint = {"machine": 148.983, "work": 52.983}
    last = {"mode": "FAULT", "fault": None, "job": job, "joints": {"Y": joint}}
    (panel.store.folder / LAST).write_text(sealed_file.text({"status": last, "facts": {}}, LAST))
    shown = run("status")
    assert shown.exit_code == 1
    assert all(one in shown.output for one in ("no service", "148.983", "line 8", "0:29", "0:50"))
    as_json = run("status", "--json")
    told = json.loads(as_json.output)
    assert as_json.exit_code == 1 and not told["ok"] and told["gone_s"] < 60.0 and told["job"] == job
    door.refused["status"] = Refusal(503, "silent", "It is there, and does not answer.")
    assert "148.983" not in run("status").output, "its tick may go on"


class Pauses:
    """Instead of waiting: what comes in each pause, then Ctrl-C."""

    def __init__(self, *happenings: Callable[[], None]) -> None:
        self._happenings = iter(happenings)

    def __call__(self, seconds: float) -> None:
        happening = next(self._happenings, None)
        if happening is None:
            raise KeyboardInterrupt
        happening()


def test_a_watch_into_a_pipe_tells_every_change_once_and_outlives_the_service(
    panel: Panel, door: NotingDoor, http: TestClient, capsys: pytest.CaptureFixture[str]
) -> None:
    gone = Refusal(503, "gone", "The service does not answer.")

    def nothing() -> None: ...

    def ends() -> None:
        door.refused["status"] = gone
        panel.watch = Watch(door)  # which remembers no status

    def comes_back() -> None:
        door.refused.clear()
        door.status = {"mode": "OFF"}
        panel.watch = Watch(door)

    client_lists.follow(remote.Machine(http), Pauses(nothing, ends, nothing, comes_back))
    told = capsys.readouterr().out.splitlines()
    assert told[0] == "READY" and told[-1] == "OFF" and len(told) == 3


def test_a_watch_in_a_terminal_shows_the_whole_view(
    panel: Panel, http: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = Console(force_terminal=True, width=80, file=StringIO(), _environ={})
    monkeypatch.setattr(client_lists.show, "console", screen)
    client_lists.follow(remote.Machine(http), Pauses())
    assert isinstance(screen.file, StringIO) and "READY" in screen.file.getvalue()


def test_alarms_are_listed_in_either_language_and_acknowledged(
    history: WrittenHistory, door: NotingDoor
) -> None:
    history.alarm("DOOR_OPEN", fault_message(Fault.DOOR_OPEN))
    assert "The door is open." in done("alarms") and "Die Tür ist offen." in done(
        "alarms", "--language", "de"
    )
    door.then["acknowledge"] = lambda: history.acknowledge(1, getattr(asker.get(), "user", ""))
    done("alarms", "--acknowledge", "1")
    assert "acknowledged by local" in done("alarms") and "The door is open." not in done("status")
    assert json.loads(done("alarms", "--json"))["alarms"][0]["acknowledged_by"] == "local"


def test_runs_are_listed(history: WrittenHistory) -> None:
    assert "Nothing was run yet." in done("runs")
    history.run("part.ngc", "completed")
    history.run(
        f"{'a long name of a part, ' * 5}with spaces.ngc",
        "refused",
        **plain("G38.2 did not touch: look at the probe."),
    )
    head, refused, why, completed = done("runs").splitlines()
    assert head.split() == ["run", "began", "took", "result", "program"]
    assert refused.startswith("2 ") and refused.endswith("with spaces.ngc")
    assert why.strip() == "G38.2 did not touch: look at the probe."
    assert completed.startswith("1 ") and completed.split()[-2:] == ["completed", "part.ngc"]
    assert json.loads(done("runs", "--json"))["runs"][1]["result"] == "completed"


def test_a_run_is_kept_by_its_number_and_let_go_again(
    panel: Panel, history: WrittenHistory, door: NotingDoor
) -> None:
    record = "2026-11-21T080000.000-part.ngc"
    number = history.run("part.ngc", record=record)
    door.then["keep_run"] = lambda: runs.keep(history.state, record, door.asked[-1][1]["on"])
    ran = run("runs", "--keep", str(number))
    assert ran.exit_code == 1 and "its record is gone" in " ".join(ran.stderr.split())
    (panel.run_records / record).mkdir(parents=True)
    assert f"The record of run {number} stays." in done("runs", "--keep", str(number))
    assert json.loads(done("runs", "--json"))["runs"][0]["facts"]["kept"] is True
    assert "completed, stays  part.ngc" in done("runs")
    assert "may go with the oldest" in done("runs", "--release", str(number))
    assert "stays" not in done("runs")
    both = run("runs", "--keep", str(number), "--release", str(number))
    assert both.exit_code == 1 and "one of them, not both" in both.stderr
    sent = [values for verb, values in door.asked if verb == "keep_run"]
    assert [values["on"] for values in sent] == [True, False]
    assert {values["record"] for values in sent} == {"2026-11-21T080000.000-part.ngc"}


# --- who does not answer


def test_where_no_panel_is_the_sentence_says_what_to_start() -> None:
    ran = run("status", "--url", DEAD)
    assert ran.exit_code == 1 and "directrix panel" in ran.stderr and DEAD in ran.stderr


def test_what_is_no_address_is_refused() -> None:
    ran = run("status", "--url", "machine")
    assert ran.exit_code == 1 and "allowed are http:// and https://" in ran.stderr


def test_the_token_comes_from_the_environment_or_the_state_folder(
    own_state_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DIRECTRIX_TOKEN", raising=False)
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    assert remote.known_token() == ""
    (own_state_folder / "directrix").mkdir(parents=True)
    (own_state_folder / "directrix" / "token").write_text("of the file\n")
    assert remote.known_token() == "of the file"
    monkeypatch.setenv("DIRECTRIX_TOKEN", "of the environment")
    assert remote.known_token() == "of the environment"


def test_a_script_with_a_token_needs_its_role(
    panel: Panel, door: NotingDoor, monkeypatch: pytest.MonkeyPatch
) -> None:
    token, sha256 = new_token()
    panel.store.users.set("anna", "no hash", "set_up")
    panel.store.users.add_token(sha256, "looker", "view", "anna")
    panel.users.refresh()
    assert run("hold").exit_code == 1 and door.asked == [], "nobody without a token"
    monkeypatch.setenv("DIRECTRIX_TOKEN", token)
    done("status")
    refused = run("hold")
    assert refused.exit_code == 1 and "looker has the role view" in refused.stderr and door.asked == []
