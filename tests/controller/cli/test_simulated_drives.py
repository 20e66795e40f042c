"""``directrix drives simulate``: a family's drives on a bus, looked at with the other commands' means."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from support.drives.hub_process import running
from typer.testing import CliRunner

from controller.cli import simulated_drives
from controller.cli.drives import app
from drives import bus, commission, pdo
from drives.bench import __main__ as drives_alone
from drives.bench.simulated.serve import Server
from drives.commissioning import sheet, survey
from drives.settings import BusSettings


@contextmanager
def simulated(path: Path, *options: str) -> Iterator[commission.Network]:
    """The command in a process of its own, and a network on its bus."""
    with running(path, "controller", "drives", "simulate", "--channel", str(path), *options) as process:
        port = bus.open(BusSettings("can", "virtual", str(path), 1_000_000), pdo.SERVICE_FILTERS)
        yield commission.Network(port, commission.wall_pump(port.fileno()))
        port.close()
        process.terminate()
        assert process.wait() == 0


def found(path: Path, *options: str) -> list[tuple[int, int]]:
    """(node, device profile) of every node that answers."""
    with simulated(path, *options) as network:
        wanted = 0
        while wanted < 3:  # nodes may still be starting up
            nodes = survey.scan(network)
            wanted = len(nodes) or wanted
            if len(nodes) >= 3:
                return [(node.node, node.device_type & 0xFFFF) for node in nodes]
    raise AssertionError


def test_drives_a_spindle_and_inputs_answer(tmp_path: Path) -> None:
    options = ("--profile", "technosoft_ipos", "--nodes", "3", "--spindle", "10", "--io", "20")
    assert found(tmp_path / "can", *options) == [(3, 402), (10, 402), (20, 401)]


def test_a_data_sheet_is_written_and_that_is_all(tmp_path: Path) -> None:
    file = tmp_path / "own.eds"
    done = CliRunner().invoke(app, ["simulate", "--profile", "maxon_epos4", "--write-eds", str(file)])
    assert done.exit_code == 0 and str(file) in done.stderr, "it would serve for ever"
    assert sheet.load(str(file), 1).dictionary[0x6060].name
    assert refusal("--write-eds", str(tmp_path / "no" / "own.eds"))


def refusal(*options: str) -> str:
    done = CliRunner().invoke(app, ["simulate", *options])
    assert done.exit_code == 1, done.output
    return done.output + done.stderr


REFUSALS: Sequence[tuple[Sequence[str], str]] = [
    (("--nodes", "0-3"), "--nodes 0-3: not a list of node ids; allowed are 1 to 127"),
    (("--io", "x"), "--io x: not a list of node ids"),
    (("--nodes", "1-3", "--io", "2"), "node 2 is named twice"),
    (("--nodes", ""), "no node is named"),
    (("--profile", "epos"), "profile epos: there is no drive profile of this name"),
    (("--machine", "trunnion", "--bus", "nobus"), "--bus nobus: there is no such bus"),
    (("--channel", "a", "--socketcan", "b"), "one or the other"),
    (("--socketcan", "nocan7"), "CAN interface nocan7"),
    (("--machine", "trunnion", "--write-eds", "a.eds"), "is the data sheet of a family"),
]


@pytest.mark.parametrize(("options", "sentence"), REFUSALS, ids=[" ".join(o) for o, _ in REFUSALS])
def test_what_it_cannot_do_is_a_sentence(options: Sequence[str], sentence: str) -> None:
    assert sentence in refusal(*options)


@pytest.mark.parametrize(("given", "bits"), [((), 51), (("--worst-stuffing",), 55)])
def test_frames_take_their_own_length_or_the_most_they_can(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: Sequence[str], bits: int
) -> None:
    lasted: list[float] = []
    sync = bytes(pdo.frame(pdo.SYNC))

    def run(server: Server, *_: object, **__: object) -> None:
        lasted.append(server.bus.frame_s(pdo.SYNC, sync))
        server.close()

    for module in (simulated_drives, drives_alone):
        monkeypatch.setattr(module, "run", run)
    assert CliRunner().invoke(app, ["simulate", "--channel", str(tmp_path / "can"), *given]).exit_code == 0
    drives_alone.main([str(tmp_path / "can"), *given])
    assert lasted == pytest.approx([bits * 1e-6, bits * 1e-6])
