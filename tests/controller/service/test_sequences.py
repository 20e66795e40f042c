"""A run that cannot be recorded is told before it starts, and starts only where somebody says so."""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from support.fakes.fake_engine import FakeEngine, done

from controller import messages
from controller.ipc.control_socket import CommandRefused
from controller.messages import text
from controller.service import room
from controller.service.command_handlers import CommandHandlers
from controller.service.service import Service
from controller.state.modes import Mode


class Usage(NamedTuple):
    total: int
    used: int
    free: int


def loaded(desk: CommandHandlers, service: Service) -> None:
    path = service.state / "part.ngc"
    path.write_text("G21 G90 G54\nG1 X10. F3000\nM30\n")
    done(desk, "load", path=str(path), name="part.ngc")


def test_with_too_little_room_nothing_starts_and_both_languages_say_why(
    desk: CommandHandlers, service: Service, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded(desk, service)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10 << 30, 10 << 30, 3 << 20))
    with pytest.raises(
        CommandRefused, match=r"part\.ngc is not started, .* has 3 MB free, and 65 MB"
    ) as error:
        done(desk, "start")
    assert error.value.code == "unrecorded" and "hat 3 MB frei" in messages.text(error.value.said, "de")
    assert engine.now.mode is Mode.READY and "arm" not in engine.orders
    assert not list((service.state / "runs").glob("*")), "nothing of it is left behind"
    done(desk, "start", unrecorded=True)
    assert engine.now.mode is Mode.RUNNING


def test_a_confirmation_is_true_and_nothing_like_it(
    desk: CommandHandlers, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded(desk, service)
    monkeypatch.setattr(room, "lacking", lambda *_: {"why": "the disk is full"})
    for said in ("yes", 1, None, False):
        with pytest.raises(CommandRefused, match=r"cannot be gone on with: the disk is full|true or false"):
            done(desk, "start", unrecorded=said)


def test_a_line_by_hand_runs_all_the_same_for_the_machine_must_be_moved(
    desk: CommandHandlers, engine: FakeEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "lacking", lambda *_: {"why": "the disk is full"})
    done(desk, "mdi", text="G0 X1")
    assert engine.now.mode is Mode.RUNNING


@pytest.fixture
def small(tmp_path: Path) -> Iterator[Path]:
    """A state folder on a disk of 8 MB."""
    folder = tmp_path / "small"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=8m", "none", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("no file system may be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def test_a_disk_that_is_really_full_or_read_only_is_told(small: Path) -> None:
    assert room.lacking(small, 1 << 20) == {}
    assert room.lacking(small, 9 << 20)["needed"] == 9
    (small / "other").write_bytes(bytes(shutil.disk_usage(small).free))
    assert "No space left" in text(room.lacking(small, 0)["why"])
    (small / "other").unlink()
    subprocess.run(["mount", "-o", "remount,ro", str(small)], check=True)
    assert "Read-only file system" in text(room.lacking(small, 0)["why"])


def test_a_quota_is_found_by_writing_and_not_by_asking(tmp_path: Path) -> None:
    """Also where root asks, whom no permission binds."""
    asked = (
        "import resource, signal; from pathlib import Path; from controller.service import room\n"
        "from controller.messages import text\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, (1000, {resource.RLIM_INFINITY}))\n"
        f"print(text(room.lacking(Path({str(tmp_path)!r}), 0)['why']))"
    )
    said = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True).stdout
    assert "File too large" in said and not list(tmp_path.rglob("*.*"))
