"""A run is judged as its drives have cut it, once, and its report has that beside the check of the plan."""

from __future__ import annotations

import asyncio
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from support.machines.recording_bench import RecordedBench
from support.machines.stepped_runs import shipped

from controller import sealed_file
from controller.api import run_report
from controller.api.run_verdicts import AS_CUT, NothingToJudge, RunVerdicts
from controller.api.service_sync import Gatherer
from controller.api.store import Store
from controller.state.modes import Mode

CONE = """G21 G90 G54 G61 G94
T2 M6
G42 R0.1
G51 X10. Y0. Z-8. I0. J0. K-8. H8. R5. D30. F1500.
G40
M30
"""
LINES = "G21 G90 G54 G61 G94\nT2 M6\nG0 X5\nM30\n"


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Of a run that cuts a surface, and of one that does not."""
    found = {}
    for name, text in (("cone", CONE), ("lines", LINES)):
        bench = RecordedBench(tmp_path_factory.mktemp(name), shipped(period_s=0.005))
        bench.started(text)
        bench.until(Mode.READY)
        found[name] = bench.ended()
    return found


@pytest.fixture
def store(tmp_path: Path, records: dict[str, Path]) -> Any:
    for record in records.values():
        shutil.copytree(record, tmp_path / "state" / "runs" / record.name)
        file = tmp_path / "state" / "runs" / record.name / "run.json"
        file.write_text(sealed_file.text({"sha256": "0" * 64, **sealed_file.read(file)}, file.name))
    store = Store(tmp_path / "state")
    Gatherer(store.database, store.folder).gather()
    yield store
    store.close()


def facts(store: Store, record: Path) -> dict[str, Any]:
    return next(dict(one.facts) for one in store.runs.list() if one.facts["record"] == record.name)


def judge_all(verdicts: RunVerdicts) -> int:
    count = 0
    while asyncio.run(verdicts.judge_next()):
        count += 1
    return count


def test_a_run_that_cuts_a_surface_is_judged_once(store: Store, records: dict[str, Path]) -> None:
    verdicts = RunVerdicts(store)
    assert judge_all(verdicts) == 1 and judge_all(RunVerdicts(store)) == 0
    cut = facts(store, records["cone"])[AS_CUT]
    assert cut["verdict"]["within"] is True and [one["line"] for one in cut["surfaces"]] == [4]
    assert 0.0 <= cut["surfaces"][0]["overcut_mm"] < 0.1 and cut["gouges"] == 0
    assert AS_CUT not in facts(store, records["lines"])
    (run,) = [one for one in store.runs.list() if AS_CUT in one.facts]
    page = run_report.page(run_report.Facts(run, {}, (), ()), "en")
    assert "Surfaces as the drives have cut them" in page and '<th scope="row">4</th>' in page


def test_what_cannot_be_judged_says_where_to_ask(store: Store, records: dict[str, Path]) -> None:
    (store.folder / "runs" / records["cone"].name / "setpoints.npz").write_bytes(b"nothing")
    assert judge_all(RunVerdicts(store)) == 1
    refused = facts(store, records["cone"])[AS_CUT]["refused"]
    assert refused["key"] == "run_not_judged" and refused["values"]["record"] == records["cone"].name


def test_a_worker_that_dies_is_recorded_and_asked_again_only_on_request(
    store: Store, records: dict[str, Path]
) -> None:
    verdicts = RunVerdicts(store, (sys.executable, "-c", "raise SystemExit(3)"))
    assert judge_all(verdicts) == 1
    refused = facts(store, records["cone"])[AS_CUT]["refused"]
    assert refused["key"] == "run_verdict_failed" and refused["values"]["record"] == records["cone"].name
    (run,) = [one for one in store.runs.list() if AS_CUT in one.facts]
    page = run_report.page(run_report.Facts(run, {}, (), ()), "en")
    assert "has ended without an answer" in page
    later = RunVerdicts(store)
    assert judge_all(later) == 0, "the next panel does not ask by itself"
    later.ask(run)
    later.ask(run)
    assert judge_all(later) == 1
    assert facts(store, records["cone"])[AS_CUT]["verdict"]["within"] is True


def test_what_has_cut_nothing_is_not_asked_for(store: Store, records: dict[str, Path]) -> None:
    (run,) = [one for one in store.runs.list() if one.facts["record"] == records["lines"].name]
    with pytest.raises(NothingToJudge):
        RunVerdicts(store).ask(run)
