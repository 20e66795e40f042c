"""Drives that commissioning would refuse are refused by ``check``, ``bus`` and ``service install``, too."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.cli import machine_check
from controller.machine import machine_file
from controller.verify.console import spoken

EDS = machine_file.SHIPPED / "eds" / "simulated_drive.eds"
TRUNNION = machine_file.SHIPPED / "trunnion.toml"
PROGRAM = "G0 X1\nM2\n"
SLIP = "1016h:01: 0x7f00c8 is needed"


def run(*words: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(command_line.app, [*map(str, words)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.fixture
def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A program, a sheet that says of 1016h:01 what the drive contradicts, and a machine with it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.ngc").write_text(PROGRAM)
    text = re.sub(r"(?m)^\[1016sub1\]$", "[1016sub1]\nHighLimit=65535", EDS.read_text("latin-1"))
    (tmp_path / "slipped.eds").write_text(text, "latin-1")
    machine(tmp_path, "")
    return tmp_path


def machine(folder: Path, more: str) -> None:
    """The trunnion with the slipped sheet on Y, and lines more there."""
    text = TRUNNION.read_text()
    (folder / "mine.toml").write_text(
        text.replace('name = "Y"', f'name = "Y"\neds = "slipped.eds"\n{more}', 1)
    )


COMMANDS = [
    ("check", "--machine", "mine.toml"),
    ("check", "part.ngc", "--machine", "mine.toml", "--store", "checks"),
    ("bus", "mine.toml"),
    ("service", "install", "--machine", "mine.toml", "--root", "image"),
]


@pytest.mark.parametrize("words", COMMANDS, ids=[" ".join(words[:2]) for words in COMMANDS])
def test_what_commissioning_would_refuse_is_refused_with_drive_object_and_way_out(
    words: tuple[str, ...], shop: Path
) -> None:
    code, out, err = run(*words)
    assert code == 1 and "drive Y (node 2)" in err and SLIP in err and "override" in err, err
    assert "can do" not in out and "have all" not in out
    code, out, err = run(*words, "--json")
    found = json.loads(out)
    assert (code, found["ok"]) == (1, False) and SLIP in found["error"]


def test_nothing_is_installed_for_drives_that_do_not_run(shop: Path) -> None:
    run("service", "install", "--machine", "mine.toml", "--root", "image")
    assert not (shop / "image").exists()


@pytest.mark.parametrize("words", COMMANDS, ids=[" ".join(words[:2]) for words in COMMANDS])
def test_overridden_it_is_accepted(words: tuple[str, ...], shop: Path) -> None:
    machine(shop, 'override = [{ object = "1016:01", high = 0xFFFFFFFF, reason = "firmware 1.1.15" }]')
    code, _, err = run(*words)
    assert code == 0, err
    if words[0] == "check":
        assert err.count("firmware 1.1.15") == 1


def test_unsupervised_is_accepted_and_warned_of(shop: Path) -> None:
    machine(shop, "unsupervised = true")
    code, out, err = run("check", "--machine", "mine.toml")
    assert code == 0 and "have all that it needs" in out.replace("\n", " ")
    assert "accepted with unsupervised = true" in err
    found = json.loads(run("check", "--machine", "mine.toml", "--json")[1])
    assert found["ok"] and len(found["sheets"]) == 1


def test_a_machine_alone_is_refused_for_its_buses_too(shop: Path) -> None:
    text = TRUNNION.read_text()
    assert "period_s = 0.002" in text
    (shop / "fast.toml").write_text(text.replace("period_s = 0.002", "period_s = 0.001", 1))
    code, _, err = run("check", "--machine", "fast.toml")
    assert code == 1 and "can0" in err, err


@pytest.mark.parametrize("name", machine_file.shipped())
def test_every_shipped_machine_passes(name: str) -> None:
    assert run("check", "--machine", name)[0] == 0


@pytest.mark.parametrize(("language", "asked"), [("en", "Please check: "), ("de", "Bitte prüfen: ")])
def test_what_hardly_any_machine_has_is_asked_about(language: str, asked: str) -> None:
    text = machine_file.load("trunnion").text.replace("counts_per_mm = 200_000", "counts_per_mm = 10")
    before = spoken.set(language)
    found = machine_check.warnings(machine_file.read(text, "coarse.toml"))
    spoken.reset(before)
    assert len(found) == 3 and all(one.startswith(asked) and "counts_per_mm = 10" in one for one in found)
