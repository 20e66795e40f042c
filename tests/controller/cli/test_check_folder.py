"""``directrix check DIR``: one table, one report, one exit code; the same on one worker, two, a cluster."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest
from support.live import dask_cluster
from support.live.dask_cluster import Cluster
from support.parts import surface_trains
from typer.testing import CliRunner

from controller import sealed_file
from controller.__main__ import app

PLACED = ("P1", "P3")


def made(folder: Path, good: int) -> Path:
    """Sound programs of a few surfaces, one that is refused, a file of subs and what is no program."""
    (folder / "fixtures").mkdir(parents=True)
    for k in range(good):
        text = surface_trains.program(2, turned_rad=0.3 * k).replace("P1", PLACED[k % 2])
        (folder / "fixtures" / f"part{k}.NGC").write_text(text)
    (folder / "bad <1>.nc").write_text("G21 G90\nG1 X1 Y2 F100 Q9\nG1 Y2 J4\n")
    (folder / "subs.ngc").write_text("(of others)\nO<way> SUB\nG1 X1 F100\nO<way> ENDSUB\nM2\n")
    (folder / "readme.txt").write_text("no program")
    (folder / ".hidden.ngc").write_text("G99")
    return folder


def checked(folder: Path, out: Path, *words: str) -> tuple[int, dict, bytes, dict[str, dict]]:
    """Exit code, JSON, report and what the stored checks hold."""
    store, report = out / "store", out / "report.html"
    out.mkdir()
    asked = ["check", str(folder), "--store", str(store), "--report", str(report), "--json", *words]
    done = CliRunner().invoke(app, asked)
    stored = {file.name: sealed_file.read(file) for file in store.glob("*.json")}
    return done.exit_code, json.loads(done.stdout), report.read_bytes(), stored


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(tmp_path_factory.mktemp("folder") / "programs", 2)


@pytest.fixture(scope="module")
def alone(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple:
    return checked(folder, tmp_path_factory.mktemp("alone") / "out", "--workers", "1")


def test_a_folder_has_a_row_per_program_and_one_exit_code(alone: tuple) -> None:
    code, found, _, stored = alone
    assert code == 1 and not found["ok"] and found["error"].startswith("3 programs: 2 passed, 1 refused, 0")
    states = {row["program"]: row["state"] for row in found["programs"]}
    good = {f"fixtures/part{k}.NGC": "passed" for k in range(2)}
    assert states == {"bad <1>.nc": "refused", "subs.ngc": "subs", **good}
    bad = found["programs"][0]
    assert bad["line"] == 2 and bad["sentence"].startswith("bad <1>.nc:2:") and "1 more" in bad["sentence"]
    assert len(stored) == 2 and {row.get("stored") for row in found["programs"]} >= {n[:-5] for n in stored}


def test_two_workers_give_the_same_to_the_last_bit(folder: Path, alone: tuple, tmp_path: Path) -> None:
    assert checked(folder, tmp_path / "two", "--workers", "2") == alone


class Cells(HTMLParser):
    """The text of every cell."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[list[str]] = []

    def handle_starttag(self, tag: str, attrs: list) -> None:
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_data(self, data: str) -> None:
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data


def test_the_report_has_the_table_and_takes_no_words_of_a_program_for_tags(alone: tuple) -> None:
    cells = Cells()
    cells.feed(alone[2].decode())
    rows = {row[0]: row[1:] for row in cells.rows if len(row) == 7}
    assert rows["bad <1>.nc"][0] == "refused" and rows["fixtures/part0.NGC"][3] == "2"
    assert "<1>" not in alone[2].decode()


def test_a_sound_folder_ends_with_0_and_speaks_german(tmp_path: Path) -> None:
    folder = made(tmp_path / "sound", 1)
    (folder / "bad <1>.nc").unlink()
    words = ["check", str(folder), "--store", str(tmp_path), "--language", "de"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0 and "1 Programme: 1 bestanden, 0 abgelehnt" in done.stdout


def test_a_folder_without_programs_and_a_report_of_a_program_are_refused(tmp_path: Path) -> None:
    empty = CliRunner().invoke(app, ["check", str(tmp_path), "--json"])
    assert empty.exit_code == 1 and "there is no part program in it" in json.loads(empty.stdout)["error"]
    (tmp_path / "part.ngc").write_text("G0 X1\n")
    asked = ["check", str(tmp_path / "part.ngc"), "--report", str(tmp_path / "r.html"), "--json"]
    alone = CliRunner().invoke(app, asked)
    assert alone.exit_code == 1 and "name a folder" in json.loads(alone.stdout)["error"]


@pytest.mark.parametrize("verb", ["check", "verify", "fit"])
def test_the_surfaces_of_one_program_are_the_same_on_two_workers(verb: str, tmp_path: Path) -> None:
    file = tmp_path / "part.ngc"
    file.write_text(surface_trains.program(3).replace("P1", "P2"))

    def told(workers: str) -> object:
        words = [verb, str(file), "--workers", workers, "--json"]
        if verb == "check":
            words += ["--store", str(tmp_path / workers)]
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, done.output
        return json.loads(done.stdout)

    assert told("2") == told("1")
    if verb == "check":
        one, two = (sealed_file.read(next((tmp_path / n).glob("*.json"))) for n in ("1", "2"))
        assert one == two and one["placements"]


# ---- a cluster ---------------------------------------------------------------------


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    pytest.importorskip("distributed")
    with dask_cluster.opened(tmp_path, 2) as cluster:
        yield cluster


@pytest.mark.slow
def test_a_cluster_gives_the_same_while_one_of_its_workers_is_killed(
    folder: Path, alone: tuple, tmp_path: Path, cluster: Cluster
) -> None:
    kept = ["--store", str(tmp_path / "store"), "--report", str(tmp_path / "report.html")]
    asked = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "controller",
            "check",
            str(folder),
            *kept,
            "--cluster",
            cluster.address,
            "--json",
        ],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    store = tmp_path / "store"
    dask_cluster.until(lambda: store.is_dir() and any(store.iterdir()))  # some are done, some are not
    cluster.workers[0].kill()
    out, _ = asked.communicate(timeout=120)
    stored = {file.name: sealed_file.read(file) for file in store.glob("*.json")}
    assert (asked.returncode, json.loads(out), (tmp_path / "report.html").read_bytes(), stored) == alone


def test_a_cluster_that_is_not_there_is_one_sentence(folder: Path) -> None:
    pytest.importorskip("distributed")
    done = CliRunner().invoke(app, ["check", str(folder), "--cluster", "tcp://127.0.0.1:9", "--json"])
    assert done.exit_code == 1 and "no Dask scheduler answers there" in json.loads(done.stdout)["error"]
