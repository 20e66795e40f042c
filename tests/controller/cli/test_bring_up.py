"""A bring-up is left and gone on with; nothing moves unasked; what is wrong is told with key and value."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
from pathlib import Path
from typing import Any

import pytest
from support.live.shop import opened
from typer.testing import CliRunner

from controller.bringup import charts, protocol, report, steps
from controller.bringup.conduct import CONDUCT, scale_of
from controller.bringup.protocol import Outcome
from controller.bringup.steps import KINDS
from controller.bringup.ticks import NotDone
from controller.cli import bring_up
from controller.cli.bring_up_worker import AtPage
from controller.cli.speech import Verbs
from controller.machine import machine_file
from controller.messages import message

app = Verbs()
app.command()(bring_up.bring_up)


def asked(*words: str, given: str = "") -> dict[str, Any]:
    done = CliRunner().invoke(app, [*words, "--json"], input=given)
    return {**json.loads(done.stdout.splitlines()[-1]), "exit": done.exit_code}


def verdicts(answer: dict[str, Any]) -> dict[str, str | None]:
    return {row["step"]: row["verdict"] for row in answer["steps"]}


def test_every_kind_of_step_is_conducted_and_a_machine_has_those_that_it_can_do() -> None:
    assert {kind.name for kind in KINDS} == CONDUCT.keys()
    of_shop = [step.name for step in steps.steps(machine_file.load("shop"))]
    assert {"estop", "sto.X", "brake.Z", "scale.C", "response.A", "circle.XZ", "clamp.A", "spindle"} <= set(
        of_shop
    )
    assert len(set(of_shop)) == len(of_shop)
    of_trunnion = {step.kind for step in steps.steps(machine_file.load("trunnion"))}
    assert not of_trunnion & {"inputs", "estop", "clamp", "changer"}


def test_nothing_is_done_that_nobody_has_agreed_to(tmp_path: Path) -> None:
    answer = asked(str(tmp_path), "--machine", "shop", "--simulate")
    assert answer["exit"] == 0 and set(verdicts(answer).values()) == {None}
    assert (tmp_path / protocol.REPORT).exists() and not (tmp_path / protocol.FILE).exists()


def test_a_scale_that_is_wrong_is_told_with_its_key_and_kept_for_the_next_time(tmp_path: Path) -> None:
    words = (str(tmp_path), "--simulate", "--yes", "scale.X", "--step", "scale.X")
    missing = asked(*words)
    assert missing["exit"] == 1 and verdicts(missing)["scale.X"] is None
    first = asked(*words, "--value", "scale.X=-9.98")
    assert first["exit"] == 1 and verdicts(first)["scale.X"] == "bad"
    second = asked(str(tmp_path), "--simulate", "--yes", "switches", "--yes", "scale.X")
    assert second["exit"] == 0 and verdicts(second)["scale.X"] == "bad"
    assert verdicts(second)["switches.X"] == verdicts(second)["switches.C"] == "good"
    page = (tmp_path / protocol.REPORT).read_text()
    assert "counts_per_mm" in page and "http" not in page.replace("http://www.w3.org/2000/svg", "")


def test_a_step_is_left_out_with_a_reason_and_not_without(tmp_path: Path) -> None:
    left = asked(str(tmp_path), "--simulate", "--list", "--skip", "rotaries=no probe", "--skip", "sto=no STO")
    assert left["exit"] == 0 and verdicts(left)["rotaries"] == verdicts(left)["sto.C"] == "skipped"
    assert "no probe" in (tmp_path / protocol.REPORT).read_text()
    unsaid = asked(str(tmp_path), "--simulate", "--list", "--skip", "rotaries=")
    assert unsaid["exit"] == 2 and "rotaries=" in unsaid["error"]


@pytest.mark.parametrize(
    ("machine", "name", "way", "gauge", "key", "share"),
    [
        ("trunnion", "X", 10.0, 9.98, "counts_per_mm", 1.0 / 0.998),
        ("trunnion", "X", 10.0, -10.0, "counts_per_mm", -1.0),
        ("trunnion", "X", -10.0, -10.5, "counts_per_mm", 1.0 / 1.05),
        ("trunnion", "C", 90.0, 91.0, "counts_per_deg", 90.0 / 91.0),
    ],
)
def test_the_scale_that_is_proposed_is_the_one_with_which_the_gauge_would_be_right(
    machine: str, name: str, way: float, gauge: float, key: str, share: float
) -> None:
    axis = next(one for one in machine_file.load(machine).axes if one.name == name)
    found = scale_of(axis, way, gauge)
    (proposed,) = found.proposals
    assert not found.good and proposed["key"] == key
    assert proposed["new"] == pytest.approx(share * proposed["old"], rel=1e-6)
    written = axis.counts_per_unit * abs(1.0 / axis.shown_per_unit)
    assert abs(proposed["old"]) == pytest.approx(abs(written))


def test_a_gauge_that_agrees_leaves_the_scale_as_it_is() -> None:
    axis = machine_file.load("trunnion").axes[0]
    assert scale_of(axis, 10.0, 10.01).good and not scale_of(axis, 10.0, 10.01).proposals
    assert not scale_of(axis, 10.0, 0.0).good and not scale_of(axis, 10.0, 0.0).proposals


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (("--step", "scale.Q"), "scale.Q"),
        (("--yes", "everything"), "everything"),
        (("--value", "scale.X=wide"), "scale.X=wide"),
        (("--value", "scale.X=nan"), "scale.X=nan"),
        (("--value", "scale.X=-inf"), "scale.X=-inf"),
        (("--value", "scale.X"), "scale.X"),
        (("--value", "scale.Q=10"), "no step scale.Q;"),
        (("--value", "scale=10"), "scale=10"),
    ],
)
def test_what_is_no_step_or_no_number_is_refused_before_anything_begins(
    words: tuple[str, ...], names: str, tmp_path: Path
) -> None:
    answer = asked(str(tmp_path / "new"), "--simulate", *words)
    assert answer["exit"] == 2 and names in answer["error"]
    assert not (tmp_path / "new").exists()


def test_who_types_what_no_gauge_says_is_asked_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("nan\n9,98\ninf\n\n9.98\n"))
    operator = bring_up.AtTerminal("scale.X", bring_up.Answers(frozenset(), {}, silent=False))
    assert operator.value(message("bringup.ask.gauge", axis="X", way=10.0, unit="mm")) == 9.98
    assert capsys.readouterr().err.count("9,98 is no number") == 1


def test_an_input_that_has_ended_is_no_answer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    operator = bring_up.AtTerminal("scale.X", bring_up.Answers(frozenset(), {}, silent=False))
    question = message("bringup.ask.gauge", axis="X", way=10.0, unit="mm")
    for ask, key in ((operator.value, "no_value"), (operator.does, "nobody")):
        with pytest.raises(NotDone) as missing:
            ask(question)
        assert missing.value.said["key"] == f"bringup.{key}"
    assert not operator.confirms(question)


def noted(folder: Path, machine: str = "trunnion", good: bool = True) -> protocol.Protocol:
    made = protocol.opened(folder, machine_file.load(machine), simulated=True)
    made.note("switches.X", Outcome(good))
    return made


def test_a_protocol_of_another_machine_or_one_that_is_damaged_is_refused(tmp_path: Path) -> None:
    noted(tmp_path)
    other = asked(str(tmp_path), "--machine", "fig4b", "--simulate", "--list")
    assert other["exit"] == 1 and "trunnion" in other["error"]
    real = asked(str(tmp_path), "--list")
    assert real["exit"] == 1 and "simulated" in real["error"]
    file = tmp_path / protocol.FILE
    for text in (
        file.read_text().replace("good", "bad"),
        "",
        "{}",
        '{"machine": "trunnion", "done": {}}',
        "[1]",
    ):
        file.write_text(text)
        damaged = asked(str(tmp_path), "--simulate", "--list")
        assert damaged["exit"] == 1 and protocol.FILE in damaged["error"], text


def test_what_was_done_with_another_machine_file_says_so(tmp_path: Path) -> None:
    made = noted(tmp_path)
    all_steps = steps.steps(machine_file.load("trunnion"))
    step = next(one for one in all_steps if one.name == "switches.X")
    assert report.verdict(made, step) == "good"
    made.note("response.Y", Outcome(True, measured={"lag_s": 3e-3}))
    assert made.measured("response", "lag_s") == {"Y": 3e-3}
    made.machine_sha256 = "of a file that was changed since"
    assert made.measured("response", "lag_s") == {}  # other axes are not held against it
    assert report.verdict(made, step) == "good, of another machine file"


def test_a_picture_is_a_line_within_its_frame() -> None:
    line = charts.series("one", *([[1.0, 10.0, 100.0]] * 2))
    one = {"title": "t", "x": "f", "y": "g", "series": [line], "shape": "log"}
    made = {**one, **{name: {"key": "text", "values": {"text": one[name]}} for name in ("title", "x", "y")}}
    drawn = report.picture(made)
    (points,) = re.findall(r'points="([^"]+)"', drawn)
    places = [tuple(map(float, pair.split(","))) for pair in points.split()]
    assert places[1][0] == pytest.approx(0.5 * (places[0][0] + places[2][0]), abs=0.1)
    assert all(0.0 <= x <= 860.0 and 0.0 <= y <= 340.0 for x, y in places)


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.calm
def test_a_machine_that_runs_is_brought_up_by_its_panel(tmp_path: Path) -> None:
    """Another machine's file is refused, and what moves it leaves it ready."""
    with opened(tmp_path) as shop:
        shop.up()
        shop.do("POST", "/machine/home", json={})
        shop.do("POST", "/machine/enable")
        where = (str(tmp_path / "protocol"), "--url", shop.url, "--take-over")
        other = asked(
            *where, "--machine", "fig4b", "--yes", "scale.X", "--step", "scale.X", "--value", "scale.X=10"
        )
        assert other["exit"] == 1 and "trunnion" in other["error"]
        words = [word for step in ("brake.Z", "scale.X", "circle.XY") for word in ("--yes", step)]
        own = (str(tmp_path / "own"), *where[1:], "--machine", str(shop.machine_file))
        found = asked(*own, *words, "--value", "scale.X=10")
        good = {step for step, verdict in verdicts(found).items() if verdict == "good"}
        assert found["exit"] == 0 and good == {"brake.Z", "scale.X", "circle.XY"}, found
        (row,) = [one for one in found["steps"] if one["step"] == "circle.XY"]
        assert row["measured"]["off_mm"] < 0.02
        assert shop.status()["mode"] == "READY"


@pytest.mark.slow
def test_what_is_proposed_of_the_spindle_is_told_with_its_own_table(tmp_path: Path) -> None:
    words = (str(tmp_path), "--machine", "machining_centre", "--simulate", "--step", "spindle")
    shown = CliRunner().invoke(app, [*words, "--yes", "spindle"]).stdout
    assert "[spindle]: spin_up_s = " in shown and "[[axis]]" not in shown


@pytest.mark.parametrize(("answer", "leaves"), [("true", False), ("null", True), ("", True)])
def test_who_leaves_the_page_s_step_while_something_is_watched_for_has_left_it(
    answer: str, leaves: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As does a panel that is gone; an answer alone says that it does not come."""
    reads, writes = os.pipe()
    with os.fdopen(writes, "w") as panel:
        panel.write(f'{{"number": 1, "answer": {answer}}}\n' if answer else "")
    with os.fdopen(reads) as stdin, contextlib.ExitStack() as raised:
        monkeypatch.setattr("sys.stdin", stdin)
        if leaves:
            raised.enter_context(pytest.raises(NotDone, match="left"))
        with AtPage().works(message("bringup.hand.estop")) as gives_up:
            assert gives_up()
