"""What is kept of a fault: the files, what is in them, and for how long."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.machines.stepped_runs import shipped

from controller.ipc.handoff import COLUMN, ROW
from controller.plan.path import path
from controller.program import blocks
from controller.runtime import recording
from controller.runtime.recording import Facts
from controller.runtime.stepped import Run, SteppedMachine
from controller.state.modes import Fault, Mode, Request
from drives import pdo
from drives.log import candump

RAPID = "G21 G90 G54 G0 Y100.\nM30\n"


def ready(folder: Path | None) -> SteppedMachine:
    stepped = SteppedMachine(shipped(), recordings=folder)
    stepped.come_up()
    return stepped


def trip_in_motion(stepped: SteppedMachine, code: int = 0x8611) -> Run:
    """A rapid in which Y's drive trips at half its way."""
    tick = stepped.tick

    def watched() -> None:
        tick()
        if stepped.joints[1] > 60.0 and stepped.cycle.modes.mode is Mode.RUNNING:
            stepped.rig.drives["Y"].inject(code, stepped.rig.now_s)

    stepped.tick = watched  # type: ignore[method-assign]
    try:
        known = blocks.read(RAPID.encode(), stepped.machine, "part.ngc")
        return stepped.run(path.trace(known, stepped.machine, stepped.kinematics, stepped.joints))
    finally:
        stepped.tick = tick  # type: ignore[method-assign]


def test_a_fault_leaves_trace_frames_and_facts_and_its_sentence_says_where(tmp_path: Path) -> None:
    stepped = ready(tmp_path)
    run = trip_in_motion(stepped)
    (folder,) = tmp_path.iterdir()
    assert run.result == "fault" and str(folder) in run.fault_text
    assert run.fault_text.startswith("Axis Y (")
    assert " mm): The axis is not where it was told to be" in run.fault_text
    assert folder.name.endswith("-FOLLOWING_ERROR-Y")
    facts = json.loads((folder / "fault.json").read_text())
    assert (facts["fault"], facts["axis"], facts["position_trusted"]) == ("FOLLOWING_ERROR", "Y", False)
    assert facts["emergencies"][1] == "8611h: following error" and not facts["emergencies"][0]
    with np.load(folder / "trace.npz") as file:
        rows = file["rows"]
        assert tuple(file["columns"]) == ROW and str(file["machine"]) == stepped.machine.text
    faults = rows[:, COLUMN["fault"]]
    first = int(np.flatnonzero(faults == Fault.FOLLOWING_ERROR)[0])
    assert 0 < first < len(rows) - 100, "what came before, and the way to standstill"
    y = rows[:, COLUMN["actual_1"]]
    assert abs(y[first] - y[first - 1]) > 0.1 and np.ptp(y[-20:]) < 1e-3
    frames = list(candump.read((folder / "frames.log").read_text().splitlines()))
    emcy = [data for _, _, data in frames if pdo.HEADER.unpack_from(data)[0] == pdo.EMCY + 2]
    assert emcy[0][8:10] == (0x8611).to_bytes(2, "little")
    assert frames[-1][0] - frames[0][0] <= recording.KEPT_S + 1e-6


def test_each_fault_has_a_recording_of_its_own(tmp_path: Path) -> None:
    stepped = ready(tmp_path)
    trip_in_motion(stepped)
    stepped.request(Request.RESET)
    stepped.tick()
    assert stepped.fault_text == ""
    stepped.come_up()
    stepped.request(Request.ESTOP)
    for _ in range(400):
        stepped.tick()
    kinds = sorted(folder.name.split("-", 3)[3] for folder in tmp_path.iterdir())
    assert kinds == ["EMERGENCY_STOP", "FOLLOWING_ERROR-Y"]


def test_nothing_is_written_without_a_fault_or_a_folder(tmp_path: Path) -> None:
    ready(tmp_path)
    assert not list(tmp_path.iterdir())
    run = trip_in_motion(ready(None))
    assert run.result == "fault" and "Recording" not in run.fault_text


def test_a_folder_that_cannot_be_written_is_told_and_stops_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    run = trip_in_motion(ready(tmp_path / "file"))
    assert "The recording could not be written to" in run.fault_text


def test_only_the_newest_recordings_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording, "KEPT", 3)
    facts = Facts(Fault.EMCY, "X", 1, 0, ())
    rows = np.zeros((2, len(ROW)))
    made = [recording.save(tmp_path, shipped(), facts, rows, {}) for _ in range(5)]
    assert sorted(tmp_path.iterdir()) == sorted(made)[-3:]


def test_recordings_go_to_the_state_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert recording.folder() == tmp_path / "directrix" / "recordings"


@pytest.mark.parametrize("part", ["trace", "frames", "facts"])
def test_a_recording_that_the_disk_does_not_take_leaves_no_half_of_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    where = {
        "trace": (np, "savez_compressed"),
        "frames": (recording.frame_log, "merged"),
        "facts": (Facts, "to_dict"),
    }
    monkeypatch.setattr(*where[part], full)
    with pytest.raises(OSError, match="No space"):
        recording.save(tmp_path, shipped(), Facts(Fault.EMCY, "X", 1, 0, ()), np.zeros((2, len(ROW))), {})
    assert list(tmp_path.iterdir()) == []
