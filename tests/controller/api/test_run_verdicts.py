"""A run is judged as its drives have cut it, once, and its report has that beside the check of the plan."""

from __future__ import annotations

import asyncio
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.fakes.fake_socket import FakeDoor
from support.machines.recording_bench import RecordedBench
from support.machines.stepped_runs import shipped

from controller import sealed_file
from controller.api import run_report
from controller.api.past import Past
from controller.api.run_report import AS_CUT
from controller.api.run_verdicts import NothingToJudge, RunVerdicts, record_name
from controller.api.service_client import Watch
from controller.api.store import Store
from controller.service import runs
from controller.state.modes import Mode
from controller.store import history
from controller.store.history import Run
from controller.store.service_store import ServiceStore

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
    runs.index(ServiceStore(tmp_path / "state"), tmp_path / "state")
    store = Store(tmp_path / "state")
    yield store
    store.close()


def judging(store: Store, *worker: tuple[str, ...]) -> RunVerdicts:
    return RunVerdicts(store, Past(store.folder, Watch(FakeDoor())), *worker)


def run_of(store: Store, record: Path) -> Run:
    with history.reading(store.folder) as past:
        (run,) = [one for one in past.runs() if record_name(one) == record.name]
    return run


def page_of(store: Store, record: Path) -> str:
    run = run_of(store, record)
    whole = replace(run, facts={**run.facts, AS_CUT: store.verdicts.get(record.name)})
    return run_report.page(run_report.Facts(whole, {}, (), ()), "en")


def judge_all(verdicts: RunVerdicts) -> int:
    count = 0
    while asyncio.run(verdicts.judge_next()):
        count += 1
    return count


def test_a_run_that_cuts_a_surface_is_judged_once(store: Store, records: dict[str, Path]) -> None:
    verdicts = judging(store)
    assert judge_all(verdicts) == 1 and judge_all(judging(store)) == 0
    cut = store.verdicts.get(records["cone"].name)
    assert cut["verdict"]["within"] is True and [one["line"] for one in cut["surfaces"]] == [4]
    assert 0.0 <= cut["surfaces"][0]["overcut_mm"] < 0.1 and cut["gouges"] == 0
    assert store.verdicts.get(records["lines"].name) is None
    page = page_of(store, records["cone"])
    assert "Surfaces as the drives have cut them" in page and '<th scope="row">4</th>' in page


def test_what_cannot_be_judged_says_where_to_ask(store: Store, records: dict[str, Path]) -> None:
    (store.folder / "runs" / records["cone"].name / "setpoints.npz").write_bytes(b"nothing")
    assert judge_all(judging(store)) == 1
    refused = store.verdicts.get(records["cone"].name)["refused"]
    assert refused["key"] == "run_not_judged" and refused["values"]["record"] == records["cone"].name


def test_a_worker_that_dies_is_recorded_and_asked_again_only_on_request(
    store: Store, records: dict[str, Path]
) -> None:
    verdicts = judging(store, (sys.executable, "-c", "raise SystemExit(3)"))
    assert judge_all(verdicts) == 1
    refused = store.verdicts.get(records["cone"].name)["refused"]
    assert refused["key"] == "run_verdict_failed" and refused["values"]["record"] == records["cone"].name
    page = page_of(store, records["cone"])
    assert "has ended without an answer" in page
    later, run = judging(store), run_of(store, records["cone"])
    assert judge_all(later) == 0, "the next panel does not ask by itself"
    later.ask(run)
    later.ask(run)
    assert judge_all(later) == 1
    assert store.verdicts.get(records["cone"].name)["verdict"]["within"] is True


def test_what_has_cut_nothing_is_not_asked_for(store: Store, records: dict[str, Path]) -> None:
    run = run_of(store, records["lines"])
    with pytest.raises(NothingToJudge):
        judging(store).ask(run)
