"""`directrix serve` tells systemd how it is; without systemd it tells nobody."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
import typer

from controller.cli import serve
from controller.machine.model import Machine
from controller.service import main


def test_without_systemd_nobody_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    serve._notifier()("READY=1")


@pytest.mark.parametrize("abstract", [False, True])
def test_systemd_hears_every_word_on_the_socket_that_it_named(
    abstract: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"@directrix-test{tmp_path}" if abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind("\0" + name[1:] if abstract else name)
        systemd.settimeout(20.0)
        monkeypatch.setenv("NOTIFY_SOCKET", name)
        tell = serve._notifier()
        for words in ("READY=1", "STATUS=OFF", "WATCHDOG=1"):
            tell(words)
            assert systemd.recv(100).decode() == words


@pytest.mark.parametrize(
    ("simulate", "late", "wanted"),
    [(True, "", "count"), (True, "stop", "stop"), (False, "", "stop"), (False, "count", "count")],
)
def test_late_ticks_stop_a_machine_and_are_counted_on_a_desk(
    simulate: bool, late: str, wanted: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    served: list[Machine] = []
    monkeypatch.setattr(main, "run", lambda machine, *_: served.append(machine))
    serve.serve("trunnion", simulate, state=tmp_path, runtime=tmp_path, late=late)
    assert served[0].late == wanted


def test_another_period_is_the_machines_and_one_out_of_range_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    served: list[Machine] = []
    monkeypatch.setattr(main, "run", lambda machine, *_: served.append(machine))
    serve.serve("trunnion", True, state=tmp_path, runtime=tmp_path, period_ms=5.0)
    assert served[0].period_s == 0.005
    with pytest.raises(typer.Exit):
        serve.serve("trunnion", True, state=tmp_path, runtime=tmp_path, period_ms=50.0)
    assert "period_s = 0.05: is out of range" in capsys.readouterr().err


def test_a_systemd_that_is_gone_ends_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "nobody"))
    serve._notifier()("WATCHDOG=1")
