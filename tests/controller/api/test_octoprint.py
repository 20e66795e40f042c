"""OctoPrint's routes, as its apps and Cura ask them: true states, and 409 for what is not done."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import httpx
import pytest
from support.fakes.panels import Scene, sentence, take_control

from controller.api import octoprint
from controller.state.modes import SHOWN_MODES

TEXT = b"G21\nG0 X0\nM2\n"


def asked(
    folder: Path, mode: str, method: str, path: str, body: Any = None, control: bool = False
) -> tuple[httpx.Response, list[str]]:
    """The answer, and the verbs that the machine took."""

    async def story() -> tuple[httpx.Response, list[str]]:
        scene = Scene(folder)
        scene.door.mode = mode
        if mode in ("RUNNING", "HOLD"):
            figures = {"fraction": 0.25, "elapsed_s": 20.4, "left_s": 59.6, "duration_s": 80.0}
            scene.door.job = {"name": "part.ngc", "sha256": "0" * 64, "state": "running", **figures}
        async with scene.client() as client:
            if not scene.store.programs.list():
                await client.post("/api/files/local", files={"file": ("part ü.ngc", TEXT)})
            if control:
                await take_control(client)
            answer = await client.request(method, path, json=body)
            return answer, scene.door.moved

    return asyncio.run(story())


def test_every_mode_of_the_machine_has_its_state() -> None:
    assert set(octoprint.STATES) == set(SHOWN_MODES)
    assert all(flags <= set(octoprint.FLAGS) for _, flags in octoprint.STATES.values())


@pytest.mark.parametrize(
    ("mode", "text", "flags"),
    [
        ("READY", "Operational", {"operational", "ready"}),
        ("RUNNING", "Printing", {"operational", "printing"}),
        ("HOLD", "Paused", {"operational", "paused"}),
        ("STOPPING", "Cancelling", {"operational", "cancelling"}),
        ("JOG", "Operational", {"operational"}),
    ],
)
def test_the_printer_tells_the_state_that_the_machine_is_in(
    tmp_path: Path, mode: str, text: str, flags: set[str]
) -> None:
    told, _ = asked(tmp_path, mode, "GET", "/api/printer")
    state = told.json()["state"]
    assert state["text"] == text and {name for name, on in state["flags"].items() if on} == flags
    assert told.json()["temperature"] == {}, "there is nothing that heats"
    assert asked(tmp_path, mode, "GET", "/api/job")[0].json()["state"] == text


@pytest.mark.parametrize(("mode", "text"), [("OFF", "Offline"), ("FAULT", "Error")])
def test_a_machine_that_is_off_or_in_a_fault_is_no_printer(tmp_path: Path, mode: str, text: str) -> None:
    told, _ = asked(tmp_path, mode, "GET", "/api/printer")
    assert told.status_code == 409 and text in sentence(told)
    found = asked(tmp_path, mode, "GET", "/api/job")[0].json()
    assert found["state"] == text and found.get("error") == ("Emergency stop." if mode == "FAULT" else None)


def test_a_service_that_is_gone_is_offline(tmp_path: Path) -> None:
    async def story() -> None:
        scene = Scene(tmp_path)
        scene.door.there = False
        async with scene.client() as client:
            found = await client.get("/api/job")
            assert (found.status_code, found.json()["state"]) == (200, "Offline")
            assert (await client.get("/api/printer")).status_code == 409
            assert (await client.post("/api/job", json={"command": "cancel"})).status_code == 503

    asyncio.run(story())


def test_the_job_tells_its_name_and_how_far_it_is(tmp_path: Path) -> None:
    found = asked(tmp_path, "RUNNING", "GET", "/api/job")[0].json()
    assert found["job"]["file"]["name"] == "part.ngc" and found["job"]["estimatedPrintTime"] == 80.0
    assert found["progress"] == {"completion": 25.0, "printTime": 20, "printTimeLeft": 60}
    nothing = asked(tmp_path, "READY", "GET", "/api/job")[0].json()
    assert nothing["job"]["file"]["name"] is None and nothing["progress"]["completion"] is None


@pytest.mark.parametrize(
    ("mode", "body", "control", "status", "verbs"),
    [
        ("RUNNING", {"command": "pause", "action": "pause"}, False, 204, ["hold"]),
        ("RUNNING", {"command": "pause"}, False, 204, ["hold"]),
        ("RUNNING", {"command": "cancel"}, False, 204, ["stop"]),
        ("HOLD", {"command": "pause", "action": "toggle"}, True, 204, ["resume"]),
        ("HOLD", {"command": "pause", "action": "resume"}, False, 409, []),
        ("HOLD", {"command": "restart"}, True, 409, []),
        ("READY", {"command": "start"}, True, 204, ["start"]),
        ("READY", {"command": "start"}, False, 409, []),
        ("OFF", {"command": "start"}, True, 409, []),
        ("READY", {"command": "pause", "action": "pause"}, False, 409, []),
        ("OFF", {"command": "cancel"}, False, 409, []),
        ("READY", {"command": "explode"}, True, 422, []),
    ],
)
def test_a_command_is_done_or_refused_as_documented(
    tmp_path: Path, mode: str, body: dict[str, str], control: bool, status: int, verbs: list[str]
) -> None:
    told, moved = asked(tmp_path, mode, "POST", "/api/job", body, control)
    assert told.status_code == status, told.text
    assert [verb for verb in moved if verb != "jog_stop"] == verbs
    assert status == 204 or sentence(told)


def test_files_are_the_programs_of_the_store_with_where_they_are(tmp_path: Path) -> None:
    for path in ("/api/files", "/api/files/local"):
        found = asked(tmp_path, "READY", "GET", path)[0].json()
        (file,) = found["files"]
        assert (file["name"], file["size"], file["origin"], file["type"]) == (
            "part ü.ngc",
            len(TEXT),
            "local",
            "machinecode",
        )
        assert 0 < found["free"] <= found["total"]
        assert asked(tmp_path, "READY", "GET", file["refs"]["download"])[0].content == TEXT
        one = asked(tmp_path, "READY", "GET", "/api/files/local/part%20%C3%BC.ngc")[0].json()
        assert one == file
    assert asked(tmp_path, "READY", "GET", "/api/files/local/none")[0].status_code == 404
