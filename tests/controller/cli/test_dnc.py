"""`directrix dnc receive` beside a service: the program in use is not replaced."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from pathlib import Path

import pytest
from support.fakes.service_stand_ins import answering, hanging
from typer.testing import CliRunner

from controller.api.dnc import LineError, LineSettings
from controller.api.dnc_format import Tape, TapeError
from controller.api.store import Store, StoreError
from controller.cli import dnc


@pytest.fixture
def store(tmp_path: Path) -> Store:
    made = Store(tmp_path / "state")
    keep(made, b"M2\n", tuple)
    return made


def keep(store: Store, text: bytes, in_use: Callable[[], Collection[str]]) -> None:
    dnc.save_tape(store, Tape(text, "O4711"), "", in_use())


def test_the_running_program_is_found_by_the_state_folder_and_not_replaced(
    store: Store, runtime: Path
) -> None:
    running = store.programs.get("O4711")
    job = {"name": running.name, "sha256": running.sha256}
    with answering(store.folder, runtime, job=job), pytest.raises(StoreError) as refused:
        keep(store, b"G4 P1\nM2\n", dnc._in_use(store.folder, None))
    assert refused.value.code == "running"
    assert store.programs.get("O4711") == running


def test_while_the_service_hangs_nobody_knows_and_nothing_is_kept(
    store: Store, runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dnc, "ANSWER_TIMEOUT_S", 0.05)
    before = store.programs.get("O4711")
    with hanging(store.folder, runtime), pytest.raises(StoreError, match="not known which program is in use"):
        keep(store, b"G4 P1\nM2\n", dnc._in_use(store.folder, None))
    assert store.programs.get("O4711") == before


def test_without_a_service_nothing_is_in_use(store: Store, runtime: Path) -> None:
    in_use = dnc._in_use(store.folder, runtime)
    keep(store, b"G4 P1\nM2\n", in_use)
    with answering(store.folder, runtime, job=None):
        keep(store, b"G4 P2\nM2\n", in_use)  # one that came meanwhile is asked
    assert store.programs.path(store.programs.get("O4711").sha256).read_bytes() == b"G4 P2\nM2\n"


def receive_forever(state: Path, *options: str) -> str:
    """Its words, once it ends all the same."""
    words = ["receive", "--forever", "--port", "/dev/null", "--state", str(state), *options]
    done = CliRunner().invoke(dnc.app, words)
    assert done.exit_code == 1
    return " ".join(done.output.split())


def test_a_bad_tape_is_told_and_the_next_one_awaited_until_the_line_itself_fails(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = [TapeError("wrong parity"), StoreError("running", "it runs"), LineError("unplugged")]
    waited: list[float] = []

    def next_one(settings: LineSettings, *_: object) -> None:
        waited.append(settings.wait_s)
        raise told[len(waited) - 1]

    monkeypatch.setattr(dnc, "_take", next_one)
    words = receive_forever(store.folder)
    assert all(str(error) in words for error in told)
    assert waited == [math.inf] * 3  # nobody has to send anything today


def test_a_setting_that_does_not_exist_ends_it_at_once(store: Store) -> None:
    assert "baud 1234 is not known" in receive_forever(store.folder, "--baud", "1234")


def test_a_port_that_is_none_ends_it_at_once(store: Store) -> None:
    assert "/dev/null: the line failed" in receive_forever(store.folder)
