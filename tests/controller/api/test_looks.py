"""The routes of the views: scope, buses, machine file, a path's picture, touching off."""

from __future__ import annotations

import asyncio
import io
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from support.fakes.panels import Scene, sentence, take_control

from controller.api.programs import ProgramCheck
from controller.ipc.handoff import COLUMN, ROW, Recorder
from controller.machine import machine_file, setup_data
from controller.plan.report.picture import Shape
from controller.runtime.recording import Facts, save
from controller.state.modes import Fault

MACHINE = machine_file.load("trunnion")
Story = Callable[[Scene, httpx.AsyncClient], Awaitable[None]]


def told(folder: Path, story: Story) -> None:
    """Play a story with a client that holds control; the machine's file is noted, as a service does."""

    async def play() -> None:
        setup_data.note(folder, MACHINE)
        scene = Scene(folder)
        async with scene.client() as client:
            await take_control(client)
            await story(scene, client)

    asyncio.run(play())


def write(scene: Scene, first: int, last: int) -> None:
    """Ticks in which X goes 0.01 mm a tick, and Z jumps at tick 700."""
    for number in range(first, last):
        row = [0.0] * len(ROW)
        row[COLUMN["tick"]] = number
        row[COLUMN["joint_command_0"]] = row[COLUMN["actual_0"]] = 0.01 * number
        row[COLUMN["joint_command_2"]] = 5.0 * (number >= 700)
        scene.door.recorder.write(row)


def test_a_scope_shows_what_the_ticks_were_and_what_came_since(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        write(scene, 0, 1200)
        found = (await client.get("/api/v1/ticks?names=X.command,X.error&first=1000&last=1003")).json()
        assert found["ticks"] == [1000, 1001, 1002, 1003] and found["per_column"] == 1
        assert found["low"]["X.command"] == [10.0, 10.01, 10.02, 10.03] and found["high"] == {}
        assert found["newest"] == 1199 and found["oldest"] == 0
        write(scene, 1200, 1900)
        await asyncio.sleep(0.05)
        found = (await client.get("/api/v1/ticks?names=X.command&most=10")).json()
        assert found["newest"] == 1899 and len(found["ticks"]) <= 10
        assert found["high"]["X.command"][-1] == pytest.approx(18.99)

    told(tmp_path, story)


def test_a_trigger_is_found_and_looked_for_only_behind_what_was_seen(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        write(scene, 0, 1000)
        path = "/api/v1/ticks/trigger?name=Z.command&level=2&edge=rising"
        assert (await client.get(path)).json()["tick"] == 700
        assert (await client.get(f"{path}&after=699")).json()["tick"] == 700
        assert (await client.get(f"{path}&after=700")).json()["tick"] is None

    told(tmp_path, story)


def test_another_tick_process_begins_another_history(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        write(scene, 5000, 5010)
        assert (await client.get("/api/v1/ticks/signals")).json()["oldest"] == 5000
        scene.door.recorder = Recorder(rows=4096)  # as the service makes one for each tick process
        write(scene, 0, 4)
        await asyncio.sleep(0.05)
        found = (await client.get("/api/v1/ticks/signals")).json()
        assert (found["oldest"], found["newest"]) == (0, 3)

    told(tmp_path, story)


def test_ticks_come_as_files(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        write(scene, 0, 100)
        text = (await client.get("/api/v1/ticks/export.csv?names=X.command&first=10&last=12")).text
        assert text.splitlines()[1:] == ["10,0,0.1", "11,0.002,0.11", "12,0.004,0.12"]
        data = (await client.get("/api/v1/ticks/export.npz?names=X.command&first=10&last=12")).content
        with np.load(io.BytesIO(data)) as file:
            assert file["X.command"] == pytest.approx([0.1, 0.11, 0.12])

    told(tmp_path, story)


def test_the_recording_of_a_fault_opens_in_the_scope(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        rows = np.zeros((20, len(ROW)))
        rows[:, COLUMN["tick"]] = np.arange(40, 60)
        rows[:, COLUMN["actual_4"]] = np.radians(30.0)
        facts = Facts(Fault.FOLLOWING_ERROR, "C", 59, 31, ("OPERATION_ENABLED",) * 5)
        made = save(scene.folder / "recordings", MACHINE, facts, rows, {})
        found = (await client.get(f"/api/v1/ticks?source=recording:{made.name}&names=C.actual,X.jerk")).json()
        assert found["ticks"][0] == 40 and found["low"]["C.actual"] == [30.0] * 20
        assert found["low"]["X.jerk"][:3] == [None] * 3

    told(tmp_path, story)


def test_the_setpoints_of_a_run_open_in_the_scope(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        folder = scene.folder / "runs" / "2026-11-21T083120.042-part.ngc"
        folder.mkdir(parents=True)
        names = ["tick", *(f"setpoint_{i}" for i in range(5))]
        rows = np.array([[0, 200_000, 0, 0, 0, 0], [1, 400_000, 0, 0, 0, 0]], dtype=np.int32)
        np.savez(folder / "setpoints.npz", columns=np.array(names), rows=rows)
        run = scene.history.run("part.ngc", record=folder.name)
        found = (await client.get(f"/api/v1/ticks?source=run:{run}&names=X.command,X.error")).json()
        assert found["low"]["X.command"] == [1.0, 2.0]
        assert found["low"]["X.error"] == [None, None]

    told(tmp_path, story)


MANY = ",".join(f"{axis}.{what}" for axis in "XYZAC" for what in ("command", "actual", "error", "jerk"))

REFUSED = [
    # path, status, part of the sentence
    ("ticks?names=Q.command", 404, "no such signal"),
    (f"ticks?names={MANY}", 409, "at most 16"),
    ("ticks?names=feed&source=recording:nothing", 404, "no such recording"),
    ("ticks?names=feed&source=recording:..", 422, "source"),
    ("ticks?names=feed&source=run:9", 404, "no such run"),
    ("ticks/trigger?name=feed&edge=up", 422, "edge"),
    ("ticks/trigger?name=feed&level=nan", 422, "level"),
    ("programs/nothing.ngc/picture", 404, "no such program"),
]


@pytest.mark.parametrize(("path", "status", "part"), REFUSED)
def test_what_is_not_there_is_refused_in_a_sentence(
    tmp_path: Path, path: str, status: int, part: str
) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        answer = await client.get(f"/api/v1/{path}")
        assert answer.status_code == status, answer.text
        assert part in sentence(answer)

    told(tmp_path, story)


def test_a_recording_that_is_damaged_is_refused_and_not_shown(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        folder = scene.folder / "recordings" / "bad"
        folder.mkdir(parents=True)
        (folder / "trace.npz").write_bytes(b"PK\x03\x04 no archive")
        answer = await client.get("/api/v1/ticks?source=recording:bad&names=feed")
        assert answer.status_code == 404 and "cannot be read" in sentence(answer)

    told(tmp_path, story)


def test_the_machine_file_is_told_with_its_lines(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        found = (await client.get("/api/v1/machine/file")).json()
        line = next(row["line"] for row in found["rows"] if row["key"] == "period_s")
        assert found["text"].splitlines()[line - 1].startswith("period_s")

    told(tmp_path, story)


def test_without_a_machine_there_is_nothing_to_look_at_and_a_sentence_says_so(tmp_path: Path) -> None:
    async def story() -> None:
        async with Scene(tmp_path).client() as client:
            answer = await client.get("/api/v1/machine/file")
            assert answer.status_code == 404 and "directrix serve" in sentence(answer)

    asyncio.run(story())


def test_runs_are_summed_by_their_result(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        for result, seconds in (("completed", 10.0), ("completed", 20.0), ("fault", 5.0)):
            scene.history.run("part.ngc", result, duration_s=seconds, cut_time_s=1.0)
        found = (await client.get("/api/v1/statistics/runs")).json()
        assert found == {
            **{"runs": 3, "failed": 1, "results": {"completed": 2, "fault": 1}},
            **{"duration_s": 35.0, "cut_time_s": 3.0},
        }

    told(tmp_path, story)


def test_a_run_is_reported_with_the_alarms_that_came_in_it(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        scene.history.alarm("BEFORE_IT", "Long over.")
        began_s = time.time()
        scene.history.alarm("FEED_LOW", "It was slow.", "X")
        run = scene.history.run("part.ngc", started_s=began_s, duration_s=10.0)
        told = await client.get(f"/api/v1/runs/{run}/report", params={"language": "de"})
        assert told.headers["content-type"].startswith("text/html")
        assert "It was slow." in told.text and "Long over." not in told.text
        assert (await client.get("/api/v1/runs/99/report")).status_code == 404

    told(tmp_path, story)


class Passed:
    """A checker whose checks have all passed and left a picture."""

    def of(self, program: Any) -> ProgramCheck:
        return ProgramCheck(program.sha256, "", "passed", 1.0, {"stored": "abc"}, 0.0)

    def ask(self, program: Any, owner: Any = None) -> None:
        """Nothing is left to do."""


def test_the_picture_of_a_checked_program_is_told(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        scene.panel.checker = Passed()  # type: ignore[assignment]
        await client.post("/api/v1/programs", files={"file": ("part.ngc", b"G21\nM30\n")})
        gone = await client.get("/api/v1/programs/part.ngc/picture")
        assert gone.status_code == 404 and "gone" in sentence(gone)
        one, two = np.array([0]), np.array([0, 1])
        tips = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.00004]])
        axes = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8000001]])
        shape = Shape(tips, two, two, two, np.zeros((0, 6)), one[:0], 0.002, axes)
        shape.save(scene.store.own / "pictures" / "abc.npz")
        answer = await client.get("/api/v1/programs/part.ngc/picture")
        known = {"If-None-Match": answer.headers["etag"]}
        again = await client.get("/api/v1/programs/part.ngc/picture", headers=known)
        assert (again.status_code, again.content) == (304, b"")
        found = answer.json()
        assert found["tips"] == [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]] and found["motions"] == [0, 1]
        assert found["axes"] == [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]]

    told(tmp_path, story)


def test_the_path_is_a_picture_too_in_a_folder_as_well(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        scene.panel.checker = Passed()  # type: ignore[assignment]
        await client.post("/api/v1/programs", files={"file": ("part.ngc", b"G21\nM30\n")})
        await client.patch("/api/v1/programs/part.ngc", json={"name": "fixtures/part.ngc"})
        two = np.array([1, 1])
        tips, axes = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]), np.array([[0.0, 0.0, 1.0]] * 2)
        shape = Shape(tips, two, two, two, np.zeros((0, 6)), two[:0], 0.002, axes)
        shape.save(scene.store.own / "pictures" / "abc.npz")
        path = "/api/v1/programs/fixtures%2Fpart.ngc/picture"
        assert (await client.get(path)).json()["kinds"] == [1, 1]
        small, large = [await client.get(f"{path}.svg?height={px}") for px in (54, 360)]
        assert small.headers["content-type"].startswith("image/svg+xml")
        assert 'viewBox="0 0 72 54"' in small.text and 'class="feed"' in small.text
        assert small.headers["etag"] != large.headers["etag"]
        known = {"If-None-Match": small.headers["etag"]}
        again = await client.get(f"{path}.svg?height=54", headers=known)
        assert (again.status_code, again.content) == (304, b"")
        for px in (0, 23, 1201):
            assert (await client.get(f"{path}.svg?height={px}")).status_code == 422

    told(tmp_path, story)


def test_touching_off_goes_to_the_service_as_it_was_typed(tmp_path: Path) -> None:
    async def story(scene: Scene, client: httpx.AsyncClient) -> None:
        scene.door.mode = "READY"
        sent = {"X": 1.0, "Z": "+0.1", "C": "360/4", "tool": 3}
        assert (await client.post("/api/v1/offsets/G54/touch_off", json=sent)).status_code == 200
        assert (await client.post("/api/v1/tools/2/touch_off", json={"Z": "5/2"})).status_code == 200
        reads = {"X": 1.0, "Z": "+0.1", "C": "360/4"}
        wanted = ("set_offset", {"name": "G54", "reads": reads, "tool": 3})
        assert scene.door.asked[-2:] == [wanted, ("set_tool", {"number": 2, "reads": {"Z": "5/2"}})]
        for path in ("offsets/G54", "tools/2"):
            assert (await client.post(f"/api/v1/{path}/touch_off", json={})).status_code == 422
        scene.door.mode = "RUNNING"
        moving = await client.post("/api/v1/offsets/G54/touch_off", json={"Z": 0.0})
        assert moving.status_code == 409

    told(tmp_path, story)
