"""A new command with a switch in the tick: a row of the table, its part of the tick, a text in each language.

A copy of Directrix is made, those four files are changed, and all that is made of the table is asked
whether it knows the command.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # a copy, and three interpreters that import all of it
ROOT = Path(__file__).resolve().parents[2]
TABLE, TICK = Path("controller/commands/table.py"), Path("controller/tick/mode.py")
TEXTS = {name: Path(f"controller/messages/{name}.json") for name in ("en", "de")}
ROW = """    Command(
        "quiet_rapids",
        Access.MOVE,
        ON,
        Request.QUIET_RAPIDS,
        bit=256,
        state="Rapids are slow.",
        rest=Rest("PUT", "cycle/quiet_rapids", "Whether rapids are slow.", body="Switch"),
        client=Client("quiet", "quiet"),
    ),
    Command(
        "override",
"""
ALLOWED = (("operate", True), ("view", False))
WORDS = {
    "help.quiet": ("Let rapids be slow.", "Eilgänge langsam fahren."),
    "help.quiet.switch": ("Off: as fast as the machine can.", "Aus: so schnell die Maschine kann."),
    "client.quiet_on": ("Rapids are slow.", "Eilgänge sind langsam."),
    "client.quiet_off": ("Rapids are fast.", "Eilgänge sind schnell."),
    "client.quiet_rapids": ("slow rapids", "langsame Eilgänge"),
}


def changed(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) == 1, (file.name, old)
    file.write_text(text.replace(old, new))


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directrix with the command: nothing but the four files is another."""
    made = tmp_path_factory.mktemp("copy")
    for folder in ("controller", "drives"):
        shutil.copytree(ROOT / folder, made / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("config", "tests"):
        (made / name).symlink_to(ROOT / name)
    changed(made / TABLE, "    ADAPTIVE_FEED = 23", "    QUIET_RAPIDS = 24\n    ADAPTIVE_FEED = 23")
    changed(made / TABLE, '    Command(\n        "override",\n', ROW)
    changed(made / TICK, "        self.single_block = False\n", "        self.single_block = False\n" + HELD)
    for i, file in enumerate(TEXTS.values()):
        texts = json.loads((made / file).read_text()) | {key: both[i] for key, both in WORDS.items()}
        (made / file).write_text(json.dumps(dict(sorted(texts.items())), ensure_ascii=False))
    return made


HELD = "        self.quiet_rapids = False  # what it does is told by whoever moves\n"
PROGRAM = """
import asyncio, json, tempfile
from pathlib import Path
from types import SimpleNamespace
import controller
from support.fakes.fake_engine import done, engine_of, served
from support.fakes.panels import Scene, take_control
from controller.api.http import routes, rule_of
from controller.api.routes.commands import facts
from controller.commands.table import COMMANDS, Request
from controller.ipc.control_socket import CommandRefused
from controller.runtime import events
from controller.service.command_handlers import CommandHandlers
from controller.state import live_state
from controller.tick.mode import Modes

made = {"folder": str(Path(controller.__file__).parent.parent)}
folder = Path(tempfile.mkdtemp())
service = served(folder)
desk = CommandHandlers(service)
done(desk, "quiet_rapids", on=True)
made["socket"] = engine_of(service).requests[-1].name
try:
    done(desk, "quiet_rapids", on="yes")
except CommandRefused as error:
    made["refused"] = error.sentence
desk.close(), service.close()
modes = Modes(SimpleNamespace(drives=[], chatter=None), 0.002)
made["tick"] = modes.request(Request.QUIET_RAPIDS, 1.0, standing=False), modes.quiet_rapids, modes.switched
made["status"] = live_state.status_values(live_state.blank()._replace(switched=256))["quiet_rapids"]
made["replayed"] = events.REQUESTS["quiet_rapids"].name
found = next(route for path, route in routes() if path.endswith("/quiet_rapids"))
made["rule"] = [rule_of(found)[0].label, rule_of(found)[1]]
made["page"] = facts(COMMANDS["quiet_rapids"]).model_dump()

scene = Scene(folder / "panel")
described = scene.app.openapi()
made["openapi"] = described["paths"]["/api/v1/cycle/quiet_rapids"]["put"]["description"]
made["field"] = described["components"]["schemas"]["Status"]["properties"]["quiet_rapids"]["description"]

async def put():
    await scene.with_users()
    async with scene.panel.running():
        answers = []
        for who in ("view", "operate"):
            async with scene.client(who) as client:
                if who == "operate":
                    await take_control(client)
                said = await client.put("/api/v1/cycle/quiet_rapids", json={"on": True})
                answers.append(said.status_code)
    return answers

made["rest"] = asyncio.run(put())
audit = [one for one in scene.store.audit.list() if "quiet" in one.action]
made["audit"] = [[one.user, one.action, one.allowed] for one in audit]
print(json.dumps(made))
"""


def run(copy: Path, *words: str) -> str:
    environment = {**os.environ, "PYTHONPATH": f"{copy}:{copy / 'tests'}", "COLUMNS": "120"}
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, cwd=copy, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_everything_that_is_made_of_the_table_knows_it(copy: Path) -> None:
    made = json.loads(run(copy, "-c", PROGRAM))
    assert made["folder"] == str(copy)
    assert (made["socket"], made["replayed"]) == ("QUIET_RAPIDS", "QUIET_RAPIDS")
    assert made["refused"] == "on 'yes': must be true or false; correct it."
    assert made["tick"] == [True, True, 256] and made["status"] is True
    assert made["rule"] == ["operate", True] and made["rest"] == [403, 200]
    assert (made["openapi"], made["field"]) == ("Whether rapids are slow.", "Rapids are slow.")
    assert made["page"]["control"] and made["page"]["modes"] is None
    assert (made["page"]["method"], made["page"]["path"]) == ("PUT", "cycle/quiet_rapids")
    action = "PUT /api/v1/cycle/quiet_rapids"
    assert sorted(made["audit"]) == [[f"token script-{who}", action, may] for who, may in ALLOWED]


@pytest.mark.parametrize("language", [0, 1])
def test_the_command_line_has_it_with_its_texts_in_each_language(copy: Path, language: int) -> None:
    name = list(TEXTS)[language]
    listed = run(copy, "-m", "controller", "--help") if not language else ""
    shown = run(copy, "-m", "controller", "quiet", "--language", name, "--help")
    assert WORDS["help.quiet"][language] in shown and WORDS["help.quiet.switch"][language] in shown
    assert "on|off" in shown and (language or "quiet" in listed)
