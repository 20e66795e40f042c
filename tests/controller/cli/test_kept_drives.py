"""``directrix drives save``, ``compare``, ``restore`` against simulated drives on a hub."""

from __future__ import annotations

import configparser
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import canopen
import pytest
from support.drives.hub_process import served
from typer.testing import CliRunner

from controller.cli.drives import app

NODES = range(1, 6)


@pytest.fixture(scope="module")
def hub(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    path = tmp_path_factory.mktemp("hub") / "can"
    with served(path, "--nodes", *map(str, NODES), nodes=NODES):
        yield str(path)


def run(*words: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, [*map(str, words)], env={"COLUMNS": "80"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout, result.stderr


def asked(*words: object) -> tuple[int, dict[str, Any]]:
    code, out, _ = run(*words, "--json")
    return code, json.loads(out)


@pytest.fixture(scope="module")
def kept(hub: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The set-up of Z, commissioned."""
    path = tmp_path_factory.mktemp("kept") / "z.dcf"
    assert asked("commission", "--channel", hub)[1]["ok"]
    code, said = asked("save", "Z", path, "--channel", hub)
    assert (code, said["ok"], said["node"], said["unread"]) == (0, True, 3, [])
    assert said["saved"] > 60 and said["left_out"]
    return path


def edited(path: Path, index: str, value: str, to: Path) -> Path:
    """The file with another ParameterValue in one section."""
    parser = configparser.RawConfigParser()
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(path, "latin-1")
    parser[index]["ParameterValue"] = value
    with to.open("w", encoding="latin-1") as file:
        parser.write(file, False)
    return to


def test_a_saved_file_is_canopens(kept: Path) -> None:
    read = canopen.import_od(str(kept))
    assert (read.node_id, read.bitrate) == (3, 1_000_000)
    assert read[0x1400][1].value == 0x203


def test_a_drive_is_as_its_file_says_until_it_is_not(hub: str, kept: Path, tmp_path: Path) -> None:
    assert asked("compare", "Z", kept, "--channel", hub) == (
        0,
        {"ok": True, "drive": "Z", "file": str(kept), "differences": []},
    )
    other = edited(kept, "6085", "4711", tmp_path / "other.dcf")
    code, said = asked("compare", "Z", other, "--channel", hub)
    (row,) = said["differences"]
    assert (code, said["ok"]) == (1, False)
    assert (row["index"], row["sub"], row["kept"]) == (0x6085, 0, 4711)
    code, out, err = run("compare", "Z", other, "--channel", hub)
    assert code == 1 and "6085h:00" in out and "4711" in out and "other.dcf" in err
    assert max(map(len, out.splitlines())) <= 80


def test_what_differs_is_put_back_and_told(hub: str, kept: Path, tmp_path: Path) -> None:
    other = edited(kept, "6086", "0", tmp_path / "other.dcf")
    other = edited(other, "6085", "4711", other)
    code, out, _ = run("restore", "Z", other, "--channel", hub)
    assert code == 0 and "6085h:00" in out and "1 objects were written" in out.replace("\n", " "), out
    assert asked("compare", "Z", other, "--channel", hub)[0] == 0
    code, said = asked("restore", "3", kept, "--channel", hub)
    assert (code, said["changed"], said["objects"][0]["index"], said["stored"]) == (0, 1, 0x6085, False)
    assert asked("compare", "Z", kept, "--channel", hub)[0] == 0
    assert asked("commission", "--channel", hub)[1]["ok"]


def test_what_the_drive_refuses_is_told_and_the_exit_code_is_1(hub: str, kept: Path, tmp_path: Path) -> None:
    other = edited(kept, "6098", "99", tmp_path / "other.dcf")
    code, said = asked("restore", "Z", other, "--channel", hub)
    (row,) = said["objects"]
    assert (code, said["ok"], row["index"]) == (1, False, 0x6098)
    assert re.search("0x0609003", row["refused"])
    code, out, _ = run("restore", "Z", other, "--channel", hub)
    assert code == 1 and max(map(len, out.splitlines())) <= 80


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("save", "Q", "q.dcf"), "the machine has no such drive; allowed are X, Y"),
        (("compare", "X", "gone.dcf"), "gone.dcf: cannot be read: No such file"),
        (("restore", "X", "gone.dcf"), "gone.dcf: cannot be read"),
        (("save", "X", "/nowhere/x.dcf"), "/nowhere/x.dcf: cannot be written: No such file"),
    ],
)
def test_what_cannot_be_done_is_a_sentence(words: tuple[str, ...], sentence: str, hub: str) -> None:
    code, said = asked(*words, "--channel", hub)
    assert (code, said["ok"]) == (1, False) and sentence in said["error"], said
