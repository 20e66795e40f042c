"""``--wait``: a verb returns with the end of its run, and its exit code says how that came."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from support.fakes.noting_door import NotingDoor
from support.fakes.written_history import WrittenHistory
from typer.testing import CliRunner, Result

from controller.__main__ import app
from controller.api.answers import Refusal
from controller.api.app_state import Panel
from controller.cli import waiting
from controller.messages import plain

ASK = CliRunner()
RUN = "2026-11-29T110000.000-part.ngc"
VERBS = (("start",), ("mdi", "G0 X1"), ("probe", "top"), ("resume",))
WHY = {"completed": None, "refused": "G38.2 did not touch.", "stopped": "Stopped in line 8."}
ENDS = (("completed", 0), ("refused", 5), ("stopped", 6), ("fault", 7), ("interrupted", 8))


def outcome(result: str | None, run: str = RUN) -> dict[str, Any]:
    why = WHY.get(result or "", f"It is {result}.") if result else None
    said = plain(why) if why else {"key": None, "values": None}
    return {"id": run, "program": "part.ngc", "result": result, "line": 8, **said}


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(waiting, "POLL_S", 0.03)  # a status is shared for less
    monkeypatch.setattr(waiting, "SILENT_S", 0.1)


@pytest.fixture
def started(panel: Panel, door: NotingDoor) -> NotingDoor:
    """Whatever is started has this run."""
    for verb in ("start", "mdi", "probe"):
        door.results[verb] = {"mode": "RUNNING", "run": RUN}
    door.status["run"] = outcome(None)
    return door


def ends(door: NotingDoor, *coming: dict[str, Any]) -> None:
    """What the statuses from here on tell of the run, the last of it from then on."""
    left = list(coming)
    door.before_status = lambda: door.status.update(run=left.pop(0) if len(left) > 1 else left[0])


def run(*words: str) -> Result:
    return ASK.invoke(app, [*words, "--wait"])


@pytest.mark.parametrize(("result", "code"), ENDS)
@pytest.mark.parametrize("words", VERBS)
def test_the_exit_code_says_how_the_run_has_ended_and_a_sentence_why(
    words: tuple[str, ...], result: str, code: int, panel: Panel, started: NotingDoor
) -> None:
    ends(started, outcome(None), outcome(None), outcome(result))
    ran = run(*words)
    assert ran.exit_code == code, ran.output
    if code:
        assert ran.stderr.strip() == WHY.get(result, f"It is {result}.") and not ran.stdout
    else:
        assert ran.stdout.strip() == "part.ngc has come to its end."
    assert panel.control.holder == ""


@pytest.mark.parametrize(("result", "code"), ENDS)
def test_a_script_gets_the_run_as_json(result: str, code: int, started: NotingDoor) -> None:
    ends(started, outcome(None), outcome(result))
    ran = run("start", "--json")
    told = json.loads(ran.stdout)
    assert ran.exit_code == code and told["ok"] is (code == 0)
    assert told["run"]["result"] == result and told["run"]["id"] == RUN and told["run"]["line"] == 8
    assert code == 0 or told["error"] == told["run"]["sentence"]


def test_what_is_refused_before_it_begins_is_waited_for_by_nobody(started: NotingDoor) -> None:
    started.refused["start"] = Refusal(409, "refused", "START is refused in OFF.", mode="OFF")
    ran = run("start")
    assert ran.exit_code == 1 and ran.stderr.strip() == "START is refused in OFF."


def test_control_is_given_back_while_it_is_waited(panel: Panel, started: NotingDoor) -> None:
    holders = list[str]()
    ends(started, outcome(None), outcome(None), outcome("completed"))
    tell = started.before_status
    started.before_status = lambda: (holders.append(panel.control.holder), tell())
    assert run("start").exit_code == 0 and holders and not any(holders)


def test_another_run_that_has_begun_since_is_not_taken_for_it(
    history: WrittenHistory, started: NotingDoor
) -> None:
    history.run("part.ngc", "stopped", record=RUN, line=8, **plain("Stopped in line 8."))
    ends(started, outcome(None), outcome(None, run="another"))
    ran = run("start")
    assert ran.exit_code == 6 and ran.stderr.strip() == "Stopped in line 8."


def test_a_service_that_is_gone_leaves_its_end_in_the_list_or_nobody_knows(
    history: WrittenHistory, started: NotingDoor
) -> None:
    ends(started, outcome(None))
    started.then["start"] = lambda: started.refused.update(status=Refusal(503, "gone", "No service."))
    ran = run("start")
    assert ran.exit_code == 8 and "not known" in ran.stderr
    history.run("part.ngc", "interrupted", record=RUN, **plain("The service ended."))
    started.refused.clear()
    started.then.clear()
    started.before_status = lambda: started.status.pop("run", None)  # another service, which has run nothing
    ran = run("start")
    assert ran.exit_code == 8 and ran.stderr.strip() == "The service ended."


def test_what_an_operator_must_do_meanwhile_is_said_once(started: NotingDoor) -> None:
    step = {**plain("Put T2 into the spindle, then resume."), "waits": False}
    started.status |= {"mode": "HOLD", "next": step}
    ends(started, *[outcome(None)] * 4, outcome("completed"))
    ran = run("start")
    assert ran.exit_code == 0 and ran.stderr.count("Put T2 into the spindle") == 1
    assert json.loads(run("start", "--json").stdout)["ok"] is True


def test_ctrl_c_ends_the_waiting_and_says_that_the_run_goes_on(
    started: NotingDoor, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(seconds: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("controller.cli.waiting.time.sleep", interrupted)
    ran = run("start")
    assert ran.exit_code == 130 and "goes on" in ran.stderr and "stop" not in started.verbs


def test_every_exit_code_is_in_the_handbook() -> None:
    page = (Path(__file__).parents[3] / "config" / "programs" / "README.md").read_text(encoding="utf-8")
    documented = {line.split("|")[1].strip() for line in page.splitlines() if line.startswith("| ")}
    assert {str(code) for code in waiting.EXIT_CODES.values()} | {"0", "2", "4", "70", "130"} <= documented


def test_a_changer_is_confirmed_only_by_who_has_looked_and_by_the_words_of_this_line(
    panel: Panel, started: NotingDoor
) -> None:
    ran = ASK.invoke(app, ["changer", "confirm", "--spindle", "0"])
    assert ran.exit_code == 1 and "--clear" in ran.stderr and not started.verbs and not panel.control.holder
    started.results["changer_confirm"] = {}
    assert ASK.invoke(app, ["changer", "confirm", "--spindle", "0", "--clear"]).exit_code == 0


def test_that_somebody_has_seen_why_a_run_ended_is_a_verb(started: NotingDoor) -> None:
    assert ASK.invoke(app, ["seen"]).exit_code == 0 and started.verbs == ["seen"]
