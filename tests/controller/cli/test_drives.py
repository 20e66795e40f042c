"""``directrix drives`` against simulated drives on a hub in a process of its own. No time is asserted."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.drives.hub_process import ROOT, served
from typer.testing import CliRunner

from controller.cli.drives import app
from controller.machine import drive_profiles, machine_file, nodes
from drives import bus, pdo
from drives.settings import BusSettings

EDS = ROOT / "config" / "eds" / "simulated_drive.eds"
NODES = range(1, 6)


@pytest.fixture(scope="module")
def hub(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A virtual bus with the drives of the trunnion."""
    path = tmp_path_factory.mktemp("hub") / "can"
    with served(path, "--nodes", *map(str, NODES), nodes=NODES):
        yield str(path)


def asked(*arguments: str) -> dict[str, Any]:
    """The one JSON object of a command, with its exit code."""
    result = CliRunner().invoke(app, [*arguments, "--json"])
    found: dict[str, Any] = json.loads(result.stdout)
    return {**found, "exit": result.exit_code}


def test_commissioning_is_done_once_and_then_already_so(hub: str) -> None:
    first = asked("commission", "--channel", hub)
    assert (first["ok"], first["exit"]) == (True, 0)
    assert [drive["name"] for drive in first["drives"]] == list("XYZAC")
    change = next(c for c in first["drives"][0]["changes"] if c["index"] == 0x607D)
    assert (change["now"], change["why"]) == (-60_000_000, "the drive must know the axis's travel")
    second = asked("commission", "--channel", hub)
    assert all(not drive["changes"] and drive["already_so"] > 30 for drive in second["drives"])
    shown = CliRunner().invoke(app, ["commission", "--channel", hub]).stdout
    assert shown.count("objects were already so") == 5


def test_a_scan_puts_the_machine_files_names_to_what_it_finds(hub: str) -> None:
    found = asked("scan", "--channel", hub)
    assert [(row["node"], row["name"]) for row in found["found"]] == list(enumerate("XYZAC", 1))
    assert found["missing"] == []


def test_status_is_told_of_all_or_of_one(hub: str) -> None:
    assert [row["name"] for row in asked("status", "--channel", hub)["drives"]] == list("XYZAC")
    (row,) = asked("status", "--channel", hub, "--drive", "A")["drives"]
    assert (row["node"], row["state"], row["error_code"]) == (4, "switch on disabled", 0)


def test_a_dump_has_every_object_with_its_default(hub: str) -> None:
    objects = asked("dump", "Z", "--channel", hub)["objects"]
    row = next(row for row in objects if (row["index"], row["sub"]) == (0x1018, 4))
    assert (row["value"], row["name"]) == (3, "Identity object.Serial number")
    assert len(objects) > 150


def test_people_get_tables(hub: str) -> None:
    for words in (["commission"], ["scan"], ["status"], ["dump", "X"]):
        result = CliRunner().invoke(app, [*words, "--channel", hub], env={"COLUMNS": "80"})
        assert result.exit_code == 0, result.output
        assert "─" in result.stdout
        assert max(map(len, result.output.splitlines())) <= 80, result.output
        assert "…" not in result.output


def test_tables_show_identifiers_mappings_and_words_in_hexadecimal(hub: str) -> None:
    def text(*words: str) -> str:
        return CliRunner().invoke(app, [*words, "--channel", hub], env={"COLUMNS": "80"}).stdout

    asked("commission", "--channel", hub)
    lines = {line.split()[0]: line for line in text("dump", "X").splitlines() if "h:" in line}
    assert "0x201" in lines["1400h:01"] and "513" not in lines["1400h:01"]
    assert "0x607a0020" in lines["1600h:02"] and "0x7f00c8" in lines["1016h:01"]
    words = text("status")
    assert "switch-on" in words and "disabled" in words
    assert len(re.findall(r"\b0x[0-9a-f]{4}\b", words)) == 5, "the statuswords"


@pytest.mark.slow
def test_a_drive_without_a_node_id_gets_the_one_of_the_machine_file_and_keeps_it(tmp_path: Path) -> None:
    path = str(tmp_path / "can")
    with served(tmp_path / "can", "--nodes", "1", "2", "255", "4", "5", nodes=(1, 2, 4, 5)):
        assert "Z (bus can0, node 3)" in asked("scan", "--channel", path)["error"]
        done = asked("commission", "--channel", path, "--set-node", "Z", "--store")
        assert done["ok"], done
        assert done["lss"]["node"] == 3
        assert all(drive["stored"] for drive in done["drives"])
        again = asked("commission", "--channel", path, "--store")
        assert not any(drive["stored"] for drive in again["drives"]), "nothing changed, nothing to store"


def test_the_drives_of_a_running_controller_are_not_touched(
    hub: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    master = replace(nodes.master_settings(machine_file.load("trunnion")), heartbeat_s=5.0)
    monkeypatch.setattr(nodes, "master_settings", lambda _: master)  # it listens for as long as that needs
    port = bus.open(BusSettings("can0", "virtual", hub, 1_000_000))
    ended = threading.Event()

    def beat() -> None:
        while not ended.wait(0.02):
            port.send(pdo.frame(pdo.HEARTBEAT + 127, b"\x05"))

    controller = threading.Thread(target=beat)
    controller.start()
    try:
        assert "a controller is running there" in asked("commission", "--channel", hub)["error"]
    finally:
        ended.set()
        controller.join()
        port.close()


def test_a_mismatch_is_refused_with_node_object_wanted_and_found(tmp_path: Path) -> None:
    other = tmp_path / "other.eds"
    text = EDS.read_text(encoding="latin-1")
    other.write_text(re.sub("0x0*402\\b", "0x777", text), encoding="latin-1")
    path = str(tmp_path / "can")
    with served(tmp_path / "can", "--nodes", *map(str, NODES), "--eds", str(other), nodes=NODES):
        said = asked("commission", "--channel", path)
        assert (said["ok"], said["exit"]) == (False, 1)
        looked = asked("scan", "--channel", path)
        assert len(looked["strangers"]) == 5
        for word in ("drive X (node 1)", "1018h:02", "0x777", "0x402"):
            assert word in said["error"]
            assert word in looked["strangers"][0]


REFUSALS: Sequence[tuple[Sequence[str], str]] = [
    (("status",), "bus can0: no channel is named"),
    (("scan", "--channel", "/nowhere/can"), "bus can0: no virtual bus at /nowhere/can"),
    (
        ("status", "--bus", "can9", "--channel", "x"),
        "--bus can9: the machine has no such bus; allowed are can0",
    ),
    (
        ("status", "--drive", "Q", "--channel", "x"),
        "--drive Q: the machine has no such drive; allowed are X, Y",
    ),
    (("dump", "Q", "--channel", "x"), "the machine has no such drive"),
    (("commission", "--machine", "trunion"), "no such machine file"),
    (("commission", "--period-ms", "50"), "period_s = 0.05: is out of range"),
    (("scan", "--machine", "trunnion_two_buses", "--channel", "x"), "choose one with --bus"),
    (("check", "--eds", "gone.eds", "--profile", "generic"), "gone.eds cannot be read"),
    (("check", "--eds", str(EDS), "--profile", "generik"), "did you mean 'generic'"),
    (("check", "--eds", str(EDS), "--profile", "generic", "--period-ms", "-1"), "is no period"),
    (("check", "--eds", str(EDS), "--profile", "maxon_epos4"), "30B0h:00 is not in simulated_drive.eds"),
    (("check", "--eds", str(EDS), "--profile", "simulated", "--period-ms", "0.12345"), "0.12345 ms cannot"),
]


@pytest.mark.parametrize(("words", "sentence"), REFUSALS, ids=[" ".join(words[:4]) for words, _ in REFUSALS])
def test_what_cannot_be_done_is_a_sentence(words: Sequence[str], sentence: str) -> None:
    said = asked(*words)
    assert (said["ok"], said["exit"]) == (False, 1)
    assert sentence in said["error"], said["error"]


def test_a_fitting_data_sheet_is_told_with_the_makers_quirks() -> None:
    said = asked(
        "check", "--eds", str(EDS), "--profile", "generic", "--period-ms", "5", "--bit-rate", "1000000"
    )
    assert (said["ok"], said["problems"], said["period_s"]) == (True, [], 0.005)
    assert any("whole milliseconds" in remark for remark in said["remarks"])


def test_a_drafted_profile_is_one_that_check_takes(tmp_path: Path) -> None:
    own = tmp_path / "mine.toml"
    said = asked("profile", str(EDS), "--output", str(own))
    assert said["ok"] and said["file"] == str(own)
    family = drive_profiles.load(str(own))
    assert Path(str(family.eds)) == EDS and family.takes_feed_forward
    assert asked("check", "--eds", str(EDS), "--profile", str(own))["problems"] == []
    again = asked("profile", str(EDS), "--output", str(own))
    assert not again["ok"] and "is there already" in again["error"]


def test_every_mismatch_is_a_line_for_people() -> None:
    words = ["check", "--eds", str(EDS), "--profile", "maxon_epos4", "--period-ms", "0.5"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 1
    lines = [
        line for line in result.stderr.splitlines() if "0.5 ms" in line or "30B0h" in line or "1018h" in line
    ]
    assert len(lines) >= 3
