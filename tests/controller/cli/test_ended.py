"""What takes long tells how far it is, and can be ended: one line, exit code 130, nothing half written."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import BinaryIO, NoReturn

import numpy as np
import pytest
from support.machines.stepped_runs import program, shipped

from controller import __main__
from controller.ipc.handoff import ROW
from controller.runtime import checked
from controller.verify import trace


def interrupted(*_: object, **__: object) -> NoReturn:
    raise KeyboardInterrupt


@pytest.mark.parametrize("as_json", [False, True])
def test_ctrl_c_is_one_line_and_exit_code_130(
    as_json: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    part, store = tmp_path / "part.ngc", tmp_path / "store"
    part.write_text("G21 G90\nG0 X1.\nM2\n")
    words = ["directrix", "check", str(part), "--store", str(store), *(["--json"] if as_json else [])]
    monkeypatch.setattr(sys, "argv", words)
    monkeypatch.setattr(checked, "check", interrupted)
    with pytest.raises(SystemExit) as ended:
        __main__.main()
    out, err = capsys.readouterr()
    assert ended.value.code == 130 and not store.exists()
    if as_json:
        assert json.loads(out) == {"ok": False, "error": __main__.ended_words()} and not err
    else:
        assert err.splitlines() == [__main__.ended_words()]


def test_a_check_tells_how_far_it_is_all_along(tmp_path: Path) -> None:
    text = program("example2_ready").encode()
    told: list[int] = []
    checked.check(checked.task(text, "part.ngc", shipped()), tmp_path, progress=told.append)
    lines = text.count(b"\n")
    assert told == sorted(told) and told[-1] == lines
    assert min(told) < 0.2 * lines and any(0.25 * lines < one < 0.95 * lines for one in told)


def test_a_trace_is_written_whole_or_not_at_all(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    task = checked.task(b"G21 G90\nG0 X1.\nM2\n", "part.ngc", shipped())
    before = tmp_path / "run.npz"
    before.write_bytes(b"of before")

    def half(file: BinaryIO, *_: object, **__: object) -> NoReturn:
        file.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(np.lib.format, "write_array", half)
    made = trace.from_rows(np.zeros((3, len(ROW))), task.machine, task.kinematics, {}, first_tick=0)
    with pytest.raises(KeyboardInterrupt):
        made.save(before)
    assert before.read_bytes() == b"of before" and list(tmp_path.iterdir()) == [before]
