"""What the service itself answers, through the panel, is as /openapi.json says: status, kind, every name.

The other tests of the panel hold their answers against it, too (``Scene.client``), but most have a fake door.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from support.fakes import as_described
from support.fakes.fake_engine import CHECKED, FakeEngine, engine_of, served
from support.fakes.panels import Scene, take_control

from controller.api.examples import EXAMPLES
from controller.api.service_client import SocketServiceClient
from controller.faults import Fault
from controller.machine import machine_file
from controller.messages import message
from controller.service.command_handlers import CommandHandlers
from controller.service.service import Service
from controller.service.socket_server import Server
from controller.state.modes import Mode

REF = "#/components/schemas/"
PLACES = {"number": "1", "code": "G83", "file": "run.json"}
NOT_ASKED = ("/programs", "/folders", "/calibration")  # with a body: what they change is in the store alone


@pytest.fixture(params=["trunnion", "shop"])
def service(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Service]:
    """Without a tool changer, and with one; without processes."""
    made = served(tmp_path / "machine", machine_file.load(request.param))
    yield made
    made.close()


@pytest.fixture
def engine(service: Service) -> FakeEngine:
    return engine_of(service)


@pytest.fixture
def scene(service: Service, tmp_path: Path) -> Iterator[Scene]:
    """A panel with something of each kind in its store."""
    path = tmp_path / "control.sock"
    server = Server(path, CommandHandlers(service))
    scene = Scene(tmp_path / "machine" / "state", SocketServiceClient(path))  # type: ignore[arg-type]
    with scene.store.uploads.begin("part.ngc") as upload:
        upload.write(b"G21\nG1 X1 F100\nM2\n")
        upload.commit()
    service.alarms.add("PROGRAM", message("stands_before"), cause=message("cause.EMCY"))
    scene.history.run("part.ngc", "fault", **message("service_ended"))
    yield scene
    server.close()


def filled(path: str, name: str) -> str:
    for place, value in {**PLACES, "name": name}.items():
        path = path.replace(f"{{{place}}}", value)
    return path


async def look(client: httpx.AsyncClient) -> int:
    """Ask all that can be looked at; each answer is held against the description by the client itself."""
    asked = 0
    for path, methods in as_described.whole()["paths"].items():
        if "get" in methods:
            await client.get(filled(path, "edge" if "svg" in path else "part.ngc"))
            asked += 1
    return asked


async def change(client: httpx.AsyncClient) -> None:
    """Ask for all else, with the examples as bodies; refused or done, the form is that of the description."""
    for path, methods in as_described.whole()["paths"].items():
        for method, operation in methods.items():
            if method == "get" or any(one in path for one in NOT_ASKED):
                continue
            schema = operation.get("requestBody", {}).get("content", {}).get("application/json", {})
            schema = schema.get("schema", {})
            model = next((one["$ref"] for one in (schema, *schema.get("anyOf", ())) if "$ref" in one), None)
            body = {"json": EXAMPLES[model.removeprefix(REF)]} if model else {}
            await client.request(method, filled(path, "G54"), **body)  # type: ignore[arg-type]


def test_whatever_it_answers_is_as_described(scene: Scene, service: Service, engine: FakeEngine) -> None:
    row = message("at.spindle", rev_min="0", coolant="x", feed="y")
    engine.answers["check"] = lambda **_: {**CHECKED, "restart": [row], "notes": [{"line": 1, **row}]}

    async def story() -> None:
        async with scene.client() as client:
            assert await look(client) > 40
            await take_control(client)
            await change(client)
            await client.post("/api/v1/job", json={"program": "part.ngc", "line": 2})
            more = {"interlock": Fault.DOOR_OPEN, "warning": Fault.DRIVE_WARNING, "fault_axis": 1}
            engine.now = engine.now._replace(mode=Mode.FAULT, fault=Fault.FOLLOWING_ERROR, **more)
            service.watch.look()
            await look(client)

    asyncio.run(story())
