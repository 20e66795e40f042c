"""The command line as a person and as a script meet it: what it prints, where, and how it ends."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from support.machines.shipped_kinds import TILTING
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.machine import machine_file
from controller.plan.report import stored
from controller.runtime import checked, stepped

PROGRAMS = Path(__file__).parent / "programs"
EXAMPLE_2 = machine_file.shipped_program("example2")
SHIPPED = ("example1", "example2", "example1_ready", "example2_ready")
CONE = "G51 X0. Y15. Z0. I0. J0. K0. H10. R10. D5. F1000.\n"


@pytest.fixture
def at_work(tmp_path, monkeypatch):
    """An empty folder to work in; programs stand in it under a bare name."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words):
    """Exit code, stdout and stderr of one command line."""
    result = CliRunner().invoke(command_line.app, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout, result.stderr


def as_json(*words):
    """Exit code and the one JSON object that stdout must be, strictly (no NaN)."""
    code, out, err = run(*words, "--json")
    assert err == ""
    assert out.count("\n") == 1

    def no_constant(name):
        raise AssertionError(f"{name} is no JSON")

    return code, json.loads(out, parse_constant=no_constant)


def refused(*words):
    """The one sentence of a refusal, the same for people and for scripts; people see the place under it."""
    code, out, err = run(*words)
    assert (code, out) == (1, ""), (out, err)
    sentence, *shown = err.splitlines()
    code, answer = as_json(*words)
    assert code == 1 and answer["ok"] is False
    assert answer["error"] == sentence
    if shown:
        line, caret = shown
        assert caret.strip() == "^" and len(caret) <= len(line) + 1, "under a column of that line"
    return answer


def program(text, name="part.ngc"):
    Path(name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return name


def ruled(upper, lower, feed=" F100."):
    """A G52 through four upper and four lower points."""
    points = [f"X{x:.9f} Y{y:.9f} Z{z:.9f}" for x, y, z in (*upper, *lower)]
    return f"G52 {points[0]}{feed}\n" + "".join(f"{point}\n" for point in points[1:])


def along(z, x=(0.0, 10.0, 20.0, 30.0), y=0.0):
    heights = z if isinstance(z, tuple) else (z,) * 4
    return [(a, y, h) for a, h in zip(x, heights, strict=True)]


# ---- refusals ----------------------------------------------------------------------


@pytest.mark.parametrize("folder", sorted((PROGRAMS / "refused").iterdir()), ids=lambda p: p.name)
def test_every_refused_text_is_told_by_file_line_and_column(folder):
    file = folder / "program.ngc"
    answer = refused("check", file)
    place = f"{file}:{answer['line']}:{answer['column']}: "
    assert answer["error"] == place + answer["sentence"]
    assert answer["file"] == str(file) and answer["line"] >= 1 and answer["column"] >= 1


WALL = ruled(along(10.0), along(0.0))
TURN = [(30.0, y, z) for z in (10.0, 0.0) for y in (0.0, -10.0, -20.0, -30.0)]
GEOMETRY = [
    # why, text, line:column, words of the sentence
    ("coincident", ruled(along(0.0), along(0.0)), "1:1", "directrix coincide"),
    ("crossing", ruled(along((10.0, 10.0, -10.0, -10.0)), along(0.0)), "1:1", "u = 0.5000 has no length"),
    ("touching inside", ruled(along((9.0, -3.0, -3.0, 9.0)), along(0.0)), "1:1", "has no length"),
    ("touching at the end", ruled(along((10.0, 10.0, 10.0, 0.0)), along(0.0)), "1:1", "at their ends too"),
    ("C1' = 0 inside", ruled([(0, 0, 10), (30, 30, 10), (0, 30, 10), (30, 0, 10)],
                             [(0, 0, 0), (30, 30, 0), (0, 30, 0), (30, 0, 0)]),
     "1:1", "stands still at u = 0.5000"),
    ("C1 a point", ruled(along(10.0), along(0.0, (5.0,) * 4)), "1:1", "C1' = 0"),
    ("folding", ruled(along(10.0, (0.0, 60.0, -30.0, 30.0)), along(0.0)), "1:1", "folds at u"),
    ("against", ruled(along(10.0, (30.0, 20.0, 10.0, 0.0)), along(0.0)), "1:1", "folds at u"),
    ("hollow", "G41 G51 X0. Y2. Z0. I0. J0. K0. H10. R2. D360. F100.\n", "1:5", "hollow of radius 2.000 mm"),
    ("concave corner", WALL + ruled(TURN[:4], TURN[4:], ""), "9:1", "concave corner of 90.0000 degrees"),
    ("travel of a cut", CONE.replace("Y15.", "Y400."), "1:1", "Z would reach -492.761 mm at u = 0.0000"),
    ("travel of G0", "G90\n G0 X500\n", "2:2", "X would reach 508.000 mm, 208.000 mm beyond its travel"),
    ("travel of G53", "G53 G0 Z400\n", "1:5", "Z would reach 400.000 mm, 100.000 mm beyond"),
    ("travel of a rotary", "G0 A-150\n", "1:1", "A would reach -150.000 deg, 30.000 deg beyond"),
    ("turns", CONE.replace("D5.", "D36000."), "1:1", "C would reach"),
    ("gouging lead", EXAMPLE_2.read_text(), "1:6", "mm too deep into the surface"),
    ("arc", "G2 X10 Y0 I3 J0 F100\n", "1:1", "ends 97.1648 mm from it"),
    ("nothing to do", "G21 G90\n", "1:1", "no block that does anything"),
]  # fmt: skip


@pytest.mark.parametrize("why, text, place, words", GEOMETRY, ids=[row[0] for row in GEOMETRY])
def test_a_part_that_cannot_be_cut_is_refused_where_it_stands(at_work, why, text, place, words):
    error = refused("check", program(text))["error"]
    assert error.startswith(f"part.ngc:{place}: ") and words in error


def test_a_tool_axis_out_of_reach_is_a_lost_branch(at_work):
    hanging = program(ruled(along(0.0, y=-30.0), along(10.0)))
    assert "no position of the rotary axes" in refused("check", hanging, "--machine", "oblique45")["error"]


def test_simulate_refuses_as_check_does_and_writes_nothing(at_work):
    bad = program("G0 X500\n")
    assert refused("simulate", bad, "--trace", "t.npz", "--plot", "p.png") == refused("check", bad)
    assert [file.name for file in at_work.iterdir()] == [bad]


def test_gouge_warn_cuts_it_anyway_and_says_so():
    code, out, err = run("check", machine_file.shipped_program("example2"), "--gouge", "warn")
    assert code == 0
    for line, what in (
        (1, "lead in"),
        (9, "lead out"),
        (1, "cut"),
        (9, "cut"),
    ):
        assert re.search(rf"ngc:{line}:6: Gouge: the {what} of [^\n]* cuts? \d", err), (line, what)
    assert "87.2733 mm of C1" in out


# ---- files and options that are not what they should be --------------------------------


FILES = [
    (("check", "none.ngc"), "none.ngc: there is no such file"),
    (("simulate", "."), "this is a folder"),
    (("check", "ok.ngc", "--machine", "nope"), "no such machine file; allowed: a path or fig4b"),
    (("check", "ok.ngc", "--machine", "."), "no such machine file"),
    (("check", "ok.ngc", "--machine", "bad.toml"), "is not TOML"),
    (("simulate", "ok.ngc", "--period-ms", "0"), "allowed: a number from 0.0005 to 0.01"),
    (("simulate", "ok.ngc", "--period-ms", "-1"), "allowed: a number from 0.0005 to 0.01"),
    (("simulate", "ok.ngc", "--period-ms", "nan"), "allowed: a number from 0.0005 to 0.01"),
    (("simulate", "ok.ngc", "--period-ms", "1"), "what would fit: a period of 2 ms"),
    (("simulate", "ok.ngc", "--period-ms", "0.5"), "what would fit: a period of 2 ms"),
    (("simulate", "ok.ngc", "--events", "none"), "none: No such file"),
    (("simulate", "ok.ngc", "--events", "."), "Is a directory"),
    (("demo", "--out", "ok.ngc"), "ok.ngc: File exists"),
]  # fmt: skip


@pytest.mark.parametrize("words, sentence", FILES, ids=[" ".join(row[0]) for row in FILES])
def test_a_wrong_file_or_value_is_one_sentence(at_work, words, sentence):
    program(CONE, "ok.ngc")
    program("[machine\n", "bad.toml")
    assert sentence in refused(*words)["error"]


@pytest.mark.parametrize("period_ms", [1, 0.5])
def test_a_period_that_does_not_fit_the_bus_is_refused_with_what_would_fit(period_ms):
    code, answer = as_json("bus", "--period-ms", period_ms)
    assert code == 1 and "what would fit: a period of 2 ms" in answer["error"]


@pytest.mark.parametrize("option", ["--trace", "--plot"])
@pytest.mark.parametrize("target", ["no/such/folder/x", "."])
def test_what_cannot_be_written_is_refused_before_anything_runs(at_work, monkeypatch, option, target):
    def never(*_):
        raise AssertionError("it ran")

    monkeypatch.setattr(stepped, "SteppedMachine", never)
    assert "check path, permission and space" in refused("simulate", program(CONE), option, target)["error"]


EVENTS = [
    ("hold", ":1: this is not JSON"),
    ("[" * 100_000, ":1: this is not JSON"),
    ("[1]", ":1: no object"),
    ('{"tick": 1, "request": "hold"}\n\n{"tick": 1, "request": "jump"}', ":3: \"request\" is 'jump'"),
    ('{"tick": 1, "request": ["hold"]}', ':1: "request" is'),
    ('{"tick": 1, "request": "hold", "at": 3}', "unknown key 'at'"),
    ('{"tick": -1, "request": "hold"}', "must be a whole number from 0"),
    ('{"tick": 1.5, "request": "hold"}', "must be a whole number from 0"),
    ('{"tick": true, "request": "hold"}', "must be a whole number from 0"),
    ('{"request": "hold"}', "must be a whole number from 0"),
    ('{"tick": 1, "request": "override"}', "override takes 0 to 200"),
    ('{"tick": 1, "request": "override", "value": 300}', "override takes 0 to 200"),
    ('{"tick": 1, "request": "rapid_override", "value": NaN}', "rapid_override takes 0 to 200"),
    ('{"tick": 1, "request": "single_block", "value": 2}', "single_block takes 0 (off) or 1 (on)"),
    ('{"tick": 1, "request": "optional_stop"}', "optional_stop takes 0 (off) or 1 (on)"),
]  # fmt: skip


@pytest.mark.parametrize("text, sentence", EVENTS, ids=[row[0][:50] for row in EVENTS])
def test_a_bad_events_file_is_refused_by_its_line(at_work, text, sentence):
    Path("e.jsonl").write_text(text)
    assert sentence in refused("simulate", program(CONE), "--events", "e.jsonl")["error"]


@pytest.mark.parametrize(
    "words", [("check",), ("check", "x", "--foo"), ("frob",), ("bus", "--period-ms", "abc")]
)
def test_a_wrong_option_is_json_too_where_json_was_asked_for(monkeypatch, capsys, words):
    monkeypatch.setattr("sys.argv", ["directrix", *words, "--json"])
    with pytest.raises(SystemExit) as end:
        command_line.main()
    out, err = capsys.readouterr()
    assert (end.value.code, err) == (2, "")
    assert json.loads(out)["ok"] is False and "--help" in out


def test_a_command_that_is_mistyped_is_told_what_was_meant():
    code, out, err = run("resme")
    assert (code, out) == (2, "")
    assert "'resume'" in err, err


@pytest.mark.parametrize("as_json", [False, True])
def test_an_error_of_our_own_is_one_sentence_and_a_file_to_send_in(at_work, monkeypatch, capsys, as_json):
    def wrong(*_: object) -> None:
        raise IndexError("index 7 is out of\nbounds")

    monkeypatch.setattr("controller.runtime.checked.task", wrong)
    monkeypatch.setattr("tempfile.tempdir", str(at_work))
    words = ["check", program(CONE), *(["--json"] if as_json else [])]
    monkeypatch.setattr("sys.argv", ["directrix", *words])
    with pytest.raises(SystemExit) as end:
        command_line.main()
    out, err = capsys.readouterr()
    assert (end.value.code, err if as_json else out) == (70, "")
    told = json.loads(out)["error"] if as_json else err.strip()
    assert "\n" not in told and "IndexError in test_command_line.py" in told
    kept = Path(re.search(r"send in (\S+)", told)[1]).read_text()
    assert "Traceback" in kept and " ".join(words) in kept


# ---- runs ------------------------------------------------------------------------------


def simulate(text, *events, options=()):
    """The figures of a run and its trace; ``events`` are (tick, request[, value])."""
    Path("e.jsonl").write_text("".join(_event(*event) for event in events))
    words = ("simulate", program(text), "--trace", "t.npz", "--events", "e.jsonl", *options)
    code, figures = as_json(*words)
    asked = figures["result"].endswith("_as_asked")
    assert (code, figures["ok"]) == ((4, False) if asked else (0, True))
    with np.load("t.npz") as file:
        return figures, {name: file[name] for name in file.files}


def _event(tick, request, value=None):
    return json.dumps({"tick": tick, "request": request} | ({} if value is None else {"value": value})) + "\n"


SHAPES = {
    "time_s": (1, None), "joint_command": (2, 5), "joint_setpoint": (2, 5), "joint_actual": (2, 5),
    "tool_tip": (2, 3), "tool_axis": (2, 3), "contact": (2, 3), "u": (1, None), "feed_mm_s": (1, None),
    "line": (1, None), "cutting": (1, None), "axes": (1, None), "period_s": (0, None), "machine": (0, None),
}  # fmt: skip


def test_a_trace_has_the_promised_fields_and_is_the_same_bit_for_bit(at_work):
    figures, trace = simulate("(a comment)\nG0 X0\n" + CONE, (200, "override", 80))
    assert set(trace) == set(SHAPES)
    n = figures["ticks"]
    for name, (dimensions, width) in SHAPES.items():
        assert trace[name].ndim == dimensions and (width is None or trace[name].shape == (n, width)), name
    assert trace["joint_command"].dtype == np.float64 and trace["joint_setpoint"].dtype == np.int32
    assert trace["cutting"].dtype == np.bool_ and trace["line"].dtype == np.int64
    cutting = trace["cutting"]
    assert cutting.any() and set(trace["line"][cutting]) == {3} and trace["line"][0] == 2
    assert np.array_equal(np.isnan(trace["u"]), ~cutting)
    assert np.array_equal(np.isnan(trace["contact"]), ~cutting[:, None].repeat(3, axis=1))
    assert np.allclose(trace["time_s"], 0.002 * np.arange(n), rtol=0, atol=1e-9)
    counts = np.round(trace["joint_command"] * 200_000.0)
    assert np.abs(counts - trace["joint_setpoint"]).max() <= 0.0
    first = Path("t.npz").read_bytes()
    simulate("(a comment)\nG0 X0\n" + CONE, (200, "override", 80))
    assert Path("t.npz").read_bytes() == first


def test_a_hold_without_resume_ends_held_and_the_trace_is_written(at_work):
    figures, trace = simulate("G0 X90\n", (50, "hold"), (10**9, "override", 50))
    assert (figures["result"], figures["fault"], figures["events_left"]) == ("held_as_asked", None, 1)
    assert "held at line 1, as asked" in figures["error"]
    last = trace["joint_command"]
    assert np.array_equal(last[-1], last[-2]) and 0.0 < last[-1][0] < 98.0


def test_a_hold_with_resume_comes_to_the_same_end(at_work):
    figures, trace = simulate("G0 X90\n", (50, "hold"), (200, "hold"), (300, "resume"))
    assert figures["result"] == "completed" and trace["joint_command"][-1][0] == pytest.approx(98.0)


@pytest.mark.parametrize("events", [[(50, "stop")], [(50, "hold"), (300, "stop")]])
def test_a_stop_ends_stopped(at_work, events):
    assert simulate("G0 X90\nG0 X0\n", *events)[0]["result"] == "stopped_as_asked"


@pytest.mark.parametrize("which, text", [("override", "G1 X9 F900\n"), ("rapid_override", "G0 X9\n")])
def test_an_override_of_zero_stands_and_is_held_until_it_is_raised(at_work, which, text):
    assert simulate(text, (0, which, 0))[0]["result"] == "held_as_asked"
    figures, _ = simulate(text, (0, which, 0), (300, which, 100))
    assert figures["result"] == "completed" and figures["ticks"] > 300


def test_an_override_that_was_lowered_can_be_raised_again_within_the_block(at_work):
    _, trace = simulate("G1 X60 F1200\n", (0, "override", 10), (500, "override", 100))
    feed = trace["feed_mm_s"]
    assert feed[100:500].max() == pytest.approx(2.0) and feed[500:].max() == pytest.approx(20.0)


def test_a_program_stop_assumes_a_resume_and_says_so(at_work):
    assert simulate("G0 X10\nM0\nG0 X0\nM0\nM30\n")[0]["assumed_resumes"] == 2
    code, out, _ = run("simulate", program("G0 X10\nM0\nM30\n"))
    assert code == 0 and "1, a resume was assumed after each" in out


def test_a_resume_in_the_events_file_is_waited_for_at_a_program_stop(at_work):
    figures, _ = simulate("G0 X10\nM0\nG0 X0\n", (400, "resume"))
    assert figures["assumed_resumes"] == 0 and figures["ticks"] > 400


@pytest.mark.parametrize(
    "text", ["M30\n", "M3 S1\nM5\n", "G4 P0.05\n", "M1\nM0\n", "G53 G0 X0 Y0\n", "M2\nG0 X900\n", "G0 X1"]
)
def test_programs_that_hardly_move_end(at_work, text):
    assert simulate(text)[0]["result"] == "completed"
    assert run("check", "part.ngc")[0] == 0


@pytest.mark.parametrize("period_ms", [4, 10])
def test_another_period_runs_at_that_period(at_work, period_ms):
    figures, trace = simulate("G0 X10\n", options=("--period-ms", period_ms))
    assert figures["period_s"] == trace["period_s"] == period_ms / 1e3
    assert figures["result"] == "completed"


def test_warnings_of_the_machine_file_are_told(at_work):
    coarse = (
        Path(machine_file.SHIPPED / "trunnion.toml")
        .read_text()
        .replace("counts_per_mm = 200_000", "counts_per_mm = 10")
    )
    Path("coarse.toml").write_text(coarse)
    _, _, err = run("check", program("G0 X1\n"), "--machine", "coarse.toml")
    assert err.count("counts_per_mm = 10: hardly any machine has that") == 3
    assert len(as_json("check", program("G0 X1\n"), "--machine", "coarse.toml")[1]["warnings"]) == 3


# ---- how it reads ------------------------------------------------------------------------


def test_what_is_printed_for_people_fits_80_columns(at_work):
    turning = program(CONE.replace("D5.", "D-720."))
    for words in (("check", turning), ("simulate", program("G0 X1\nM0\n", "b.ngc")), ("bus",)):
        code, out, err = run(*words)
        assert code == 0 and err == ""
        assert max(map(len, out.splitlines())) <= 80, out
    assert "typical" in out and "%" in out


def test_bus_as_json_is_the_budget_of_the_design():
    code, answer = as_json("bus")
    assert code == 0 and answer["buses"][0]["total_us"] == pytest.approx(1205.0)


# ---- the table of check and stored checks ----------------------------------------------------


def test_the_table_of_check_has_a_row_per_block_and_names_what_binds(at_work):
    text = "G0 X20\nG1 X60 F60000\nG4 P0.5\n" + CONE.replace("F1000.", "F100.")
    code, out, _ = run("check", program(text))
    assert code == 0 and max(map(len, out.splitlines())) <= 80
    what = ("rapid", "line", "dwell", "cone", "approach", "departure")
    for words in (*what, "X velocity", "feed", " of 100 "):
        assert words in out, words


# Of the block, at least: as auto lays Example 2, X is at its limit for nearly as long as Y.
SLOW = [("example1_ready", 8, "C velocity", 0.5), ("example2_ready", 10, "Y velocity", 0.33)]


@pytest.mark.parametrize("name, line, binds, share", SLOW, ids=["cone", "ruled"])
def test_at_low_limits_the_check_of_the_papers_parts_names_what_binds(at_work, name, line, binds, share):
    text = machine_file.shipped_program(name).read_text().replace("F100.", "F1000.")
    words = ("check", program(text), "--machine", "xyzac_linuxcnc")
    if line == SLOW[0][1]:
        code, out, _ = run(*words)
        assert code == 0 and binds in out
    _, found = as_json(*words)
    (cut,) = (block for block in found["blocks"] if block["line"] == line)
    assert cut["feed_mm_min"] == 1000.0 > 1.2 * cut["feed_mean_mm_min"]
    most = cut["binds"][0]
    assert most["what"] == binds and most["share"] > share
    assert most["what"] == f"{most['axis']} {most['kind']}"
    assert cut["max_ratio"][most["axis"]][most["kind"]] == pytest.approx(0.998, abs=0.01)
    assert any(one["what"] == binds and one["to_s"] > one["from_s"] for one in cut["where"])


def test_the_duration_of_check_is_that_of_simulate(at_work):
    text = "G0 X20\nM0\nG4 P0.0303\n" + CONE + "M0\nM30\n"
    _, found = as_json("check", program(text))
    figures, trace = simulate(text)
    assert found["ticks"] == figures["ticks"] == len(trace["time_s"])
    assert found["duration_s"] == pytest.approx(figures["duration_s"], abs=1e-9)


def test_programs_of_many_blocks_show_the_longest_in_the_table_and_all_in_json(at_work):
    text = "".join(f"G1 X{10 + i % 7} Y{i} F5000\n" for i in range(60))
    _, out, _ = run("check", program(text))
    assert "20 more with --json" in out and out.count("line ") <= 42
    _, found = as_json("check", "part.ngc")
    assert [block["line"] for block in found["blocks"]] == list(range(1, 61)) and len(found["blocks"]) == 60


@pytest.fixture
def no_second_look(monkeypatch):
    """From now on nobody may look at a whole program."""

    def never(*_, **__):
        raise AssertionError("the program was checked again")

    def forbid():
        monkeypatch.setattr(checked, "chosen_for", never)
        monkeypatch.setattr(checked.survey, "survey", never)

    return forbid


def test_a_stored_check_is_all_that_a_start_needs(at_work, no_second_look):
    text = "G0 X10\n" + CONE
    _, found = as_json("check", program(text))
    _, before = simulate(text)
    assert found["stored"] and len(list(stored.folder().iterdir())) == 1
    no_second_look()
    figures, trace = simulate(text)
    assert figures["checked"] is True and np.array_equal(before["joint_command"], trace["joint_command"])
    with pytest.raises(AssertionError, match="checked again"):
        simulate(text + "G0 X11\n")


def test_checks_are_stored_where_they_are_asked_for(at_work, no_second_look):
    assert as_json("check", program(CONE), "--store", "shop")[0] == 0
    (file,) = Path("shop").iterdir()
    no_second_look()
    assert as_json("simulate", "part.ngc", "--store", "shop")[0] == 0
    with pytest.raises(AssertionError, match="checked again"):
        as_json("simulate", "part.ngc")
    assert json.loads(file.read_text())["ticks"] > 0


def test_a_damaged_check_is_one_warning_and_checked_again(at_work):
    run("check", program("G0 X10\n"))
    (file,) = stored.folder().iterdir()
    file.write_text("{")
    code, out, err = run("simulate", "part.ngc")
    assert code == 0 and "completed" in out
    assert err.count("; the program is checked again.") == 1


def test_a_check_that_cannot_be_stored_is_sound_and_says_so(at_work):
    Path("full").write_text("")
    code, out, err = run("check", program("G0 X10\n"), "--store", "full")
    assert code == 0 and "can run" in out and "could not be stored" in err
    assert as_json("check", "part.ngc", "--store", "full")[1]["stored"] is None


def test_a_refused_program_is_not_stored(at_work):
    refused("check", program("G0 X500\n"))
    assert not stored.folder().exists()


def test_unchecked_starts_at_once_and_stops_on_the_path_before_a_refused_block(at_work, no_second_look):
    no_second_look()
    text = program("G0 X10\nG1 X40 F3000\nG1 X60\n(there)\nG0 X500\nG0 X0\n")
    code, answer = as_json("simulate", text, "--unchecked", "--trace", "t.npz")
    assert (code, answer["ok"], answer["result"], answer["line"]) == (1, False, "refused", 5)
    assert "part.ngc:5:1: X would reach" in answer["error"] and "stands on the path" in answer["error"]
    with np.load("t.npz") as file:
        joints = file["joint_command"]
    assert joints[-1][0] == pytest.approx(68.0) and np.array_equal(joints[-1], joints[-2])


def test_unchecked_runs_a_sound_program_to_its_end(at_work, no_second_look):
    no_second_look()
    code, figures = as_json("simulate", program("G0 X10\n" + CONE), "--unchecked")
    assert (code, figures["result"], figures["checked"]) == (0, "completed", False)


# ---- all that is shipped -------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("machine", TILTING)
def test_every_shipped_program_can_run_on_every_shipped_machine_that_tilts_the_tool(machine):
    for name in SHIPPED:
        code, found = as_json(
            "check", machine_file.shipped_program(name), "--machine", machine, "--gouge", "warn"
        )
        lengths = [94.2478] if "1" in name else [50.5115, 36.7618]
        assert code == 0 and found["cuts_mm"] == pytest.approx(lengths, abs=1e-4), name


@pytest.mark.slow
@pytest.mark.parametrize("machine", TILTING)
def test_the_cone_is_simulated_on_every_shipped_machine_as_long_as_planned(machine):
    words = (machine_file.shipped_program("example1"), "--machine", machine)
    _, found = as_json("check", *words)
    code, figures = as_json("simulate", *words)
    assert (code, figures["result"], figures["skips"]) == (0, "completed", 0)
    assert figures["duration_s"] == pytest.approx(found["duration_s"], abs=0.1)
    assert figures["cut_length_mm"] == pytest.approx(94.2478, abs=1e-3)


@pytest.mark.slow
def test_the_shipped_machining_centre_changes_its_tools_as_its_description_shows(at_work):
    description = (machine_file.SHIPPED / "README.md").read_text()
    text = re.search(r"printf '([^']*)' > two_tools\.ngc", description)[1].replace("\\n", "\n")
    assert text.count(" M6\n") == 2
    code, figures = as_json("simulate", program(text), "--machine", "machining_centre")
    assert (code, figures["result"], figures["skips"]) == (0, "completed", 0)
    code, found = as_json("simulate", program(text.replace("T3", "T7")), "--machine", "machining_centre")
    assert code == 1 and "T7" in found["error"]


def test_check_draws_a_picture_of_path_times_limits_and_travel(tmp_path: Path) -> None:
    picture = tmp_path / "check.png"
    part = tmp_path / "part.ngc"
    part.write_text("G21 G90 G54\nG1 X5. F1000.\nG1 Y7.\nM30\n")
    words = ["check", str(part), "--store", str(tmp_path / "store"), "--plot", str(picture)]
    done = CliRunner().invoke(command_line.app, words)
    assert done.exit_code == 0, done.output
    head = picture.read_bytes()[:24]
    assert head.startswith(b"\x89PNG") and int.from_bytes(head[16:20]) == 1600
    folder = CliRunner().invoke(command_line.app, ["check", str(tmp_path), "--plot", str(picture)])
    assert folder.exit_code == 1 and "of one program" in folder.output.replace("\n", " ")
