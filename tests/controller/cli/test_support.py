"""``directrix support``: all that helps is in it, and nothing that lets somebody in."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import os
import random
import string
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fakes.panels import Scene
from support.fakes.written_history import WrittenHistory
from support.faults.harm import times
from support.suite.seed import SEED
from typer.testing import CliRunner

from controller import sealed_file
from controller.__main__ import app
from controller.api import notice_settings
from controller.api.store import Store
from controller.cli import internal_error, redaction, support
from controller.ipc.asker import Asker as AskedBy
from controller.ipc.handoff import ROW
from controller.machine import machine_file, setup_data
from controller.machine.model import Machine
from controller.messages import message
from controller.runtime import recording
from controller.service import runs
from controller.service.requests import Requests
from controller.state.modes import Fault
from controller.state.setpoints import SETPOINTS
from controller.store import service_store

WEBHOOK, PASSWORD, OUTSIDE = "https://chat.example/hooks/k3y-of-hook", "pass-of-mail", "what-is-elsewhere"
TYPED = "typed-by-hand"


def state_of_a_shop(folder: Path) -> list[bytes]:
    """A state folder with users, tokens, settings, a run and a crash; its secrets."""
    scene = asyncio.run(Scene(folder).with_users())
    hashes = [user.password for user in scene.store.users.all()]
    scene.store.settings.set(notice_settings.SECRETS[0], WEBHOOK, "anna")
    scene.store.settings.set(notice_settings.PASSWORD, PASSWORD, "anna")
    scene.store.audit.add("anna", "10.0.0.7", "log in", "", True)
    scene.history.run("part.ngc", "completed")
    setup_data.note(folder, machine_file.load("trunnion"))
    service_store.put(folder, "journal", {"format": 1})
    with contextlib.closing(service_store.ServiceStore(folder)) as store:
        noted = Requests(store)
        words = {"text": f"(password={TYPED})"}
        with noted.noted("mdi", words, AskedBy("anna", "set_up", "10.0.0.7"), "panel") as hear:
            hear({})
        noted.close()
    run = folder / "runs" / "0001"
    run.mkdir(parents=True)
    (run / "run.json").write_text('{"result": "completed"}')
    return [
        one.encode()
        for one in (*hashes, *scene.tokens.values(), WEBHOOK, PASSWORD, TYPED, OUTSIDE, "10.0.0.7")
    ]


def written(state: Path, archive: Path) -> dict[str, bytes]:
    done = CliRunner().invoke(app, ["support", str(archive), "--state", str(state), "--json"])
    assert done.exit_code == 0 and json.loads(done.stdout)["ok"], done.output
    with zipfile.ZipFile(archive) as file:
        return {name: file.read(name) for name in file.namelist()}


def test_what_helps_is_in_it_and_no_secret(tmp_path: Path) -> None:
    state = tmp_path / "state"
    secrets = state_of_a_shop(state)
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "key").write_text(OUTSIDE)
    (state / "runs" / "0002").symlink_to(tmp_path / "outside")
    os.symlink(tmp_path / "outside" / "key", state / "runs" / "0001" / "planted.json")
    parts = written(state, tmp_path / "case.zip")
    assert {"facts.json", "host.json", "machine.toml", "state/service.json", "store.json"} <= set(parts)
    assert parts["runs/0001/run.json"] == b'{"result": "completed"}'
    (asked,) = json.loads(parts["state/service.json"])["requests"]
    assert (asked["verb"], asked["role"], asked["peer"]) == ("mdi", "set_up", "panel")
    assert json.loads(parts["state/service.json"])["runs"][0]["program"] == "part.ngc"
    assert machine_file.read(parts["machine.toml"].decode(), "machine.toml").name
    assert b"planted.json" in parts["missing.txt"] and not any("0002" in name for name in parts)
    for name, data in parts.items():
        assert not [one for one in secrets if one in data], name


def test_a_long_record_goes_along_as_far_as_there_is_room_its_events_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(support, "MAX_BYTES", 10_000)
    state = tmp_path / "state"
    state_of_a_shop(state)
    run = state / "runs" / "0001"
    (run / "events.jsonl").write_bytes(b" " * 500)
    for n in range(5):
        (run / f"setpoints.{n:010d}.npz").write_bytes(bytes(4000 + n))
    parts = written(state, tmp_path / "case.zip")
    assert {"runs/0001/run.json", "runs/0001/events.jsonl", "runs/0001/setpoints.0000000001.npz"} <= set(
        parts
    )
    missing = parts["missing.txt"].decode()
    for n in range(5):
        name = f"runs/0001/setpoints.{n:010d}.npz"
        assert (name in missing) is (n > 1) and (name in parts) is (n <= 1)


def planted_everywhere(state: Path, words: list[str]) -> None:
    """In every file that goes along, and in names of its own."""
    for number, word in enumerate(words):
        run = state / "runs" / "0001"
        (run / f"notes{number}.txt").write_text(f"a\n{word}\nb")
        (run / "events.jsonl").write_text(json.dumps({"request": "begin", "value": word}) + "\n")
        for folder in ("recordings/1", "crashes"):
            (state / folder).mkdir(parents=True, exist_ok=True)
            (state / folder / f"{number}.txt").write_text(f"directrix panel {word}\nKeyError: {word!r}")
    machine = machine_file.load("trunnion")
    words_of_machine = replace(machine, text=machine.text + "".join(f"# {word}\n" for word in words))
    facts = recording.Facts(Fault.EMERGENCY_STOP, "", 1, 0, ())
    recording.save(state / "recordings", words_of_machine, facts, np.zeros((2, len(ROW))), {})
    (state / "usage.json").write_text(json.dumps({"items": words}))
    lines = [json.dumps({"id": 1, "time_s": 1.0, "name": "X", "acknowledged_s": None, "values": words})]
    (state / "alarms.jsonl").write_text("\n".join(lines))
    note = setup_data.note_of(machine_file.load("trunnion"))
    note["text"] += "".join(f"# {word}\n" for word in words if "\n" not in word)
    (state / setup_data.MACHINE).write_text(sealed_file.text(note, setup_data.MACHINE))


def test_secrets_that_stand_anywhere_are_taken_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state = tmp_path / "state"
    known = [one.decode() for one in state_of_a_shop(state)[:-3]]
    with contextlib.closing(Store(state)) as store:
        for name, value in (
            ("user", "mail-user-77"),
            ("sender", "shop@works.example"),
            ("to", "a@b.example,c@d.example"),
        ):
            store.settings.set(notice_settings.PREFIX + name, value, "anna")
        hashes = list(store.users.by_hash())
    known += [
        "mail-user-77",
        "shop@works.example",
        "a@b.example",
        "c@d.example",
        *hashes,
        "/hooks/k3y-of-hook",
    ]
    secrets = {
        "Authorization: Bearer abcdef.GHI-jkl_012": "abcdef.GHI-jkl_012",
        "authorization: Basic QWxhZGRpbjpv": "QWxhZGRpbjpv",
        "smtp://box:open-sesame@mail.example/": "open-sesame",
        "--password Tr0ub4dor": "Tr0ub4dor",
        "password = 'correct-horse'": "correct-horse",
        '"api_key": "0123-4567-89"': "0123-4567-89",
        '"password": "correct horse battery", "to": 7': "horse battery",
        'args: {\\"text\\": \\"(passwort: \\\\\'geheim 99\\\\\')\\"}': "geheim 99",
        "kennwort=geheim99": "geheim99",
        "['directrix', '--token', 'Tr0ub4dor-2']": "Tr0ub4dor-2",
        "Set-Cookie: directrix=c00kie_of-anna; HttpOnly": "c00kie_of-anna",
        '"cookie": "directrix=c00kie-2"': "c00kie-2",
        "POST https://chat.example/v1?space=a&key=k3y-of-before": "k3y-of-before",
        "-----BEGIN EC PRIVATE KEY-----\nMHcCAQEEIIx\n-----END EC PRIVATE KEY-----": "MHcCAQEEIIx",
        "dx_" + "q7" * 12: "q7" * 12,
    }
    planted_everywhere(state, [*known, *secrets])
    monkeypatch.setattr(support, "_journal", lambda: "\n".join([*known, *secrets]).encode())
    parts = written(state, tmp_path / "case.zip")
    wanted = {"journal.txt", "machine.toml", "state/alarms.jsonl", "state/usage.json", "crashes/0.txt"}
    assert wanted <= parts.keys() and "recordings/1/0.txt" in parts and "runs/0001/notes0.txt" in parts
    (trace,) = (name for name in parts if name.endswith("trace.npz"))
    packed = np.load(io.BytesIO(parts[trace]))
    assert len(packed["rows"]) == 2
    parts[trace] = str(packed["machine"]).encode()
    for name, data in parts.items():
        found = [one for one in (*known, *secrets.values()) if one.encode() in data]
        assert not found, (name, found)
    assert machine_file.read(parts["machine.toml"].decode(), "machine.toml").name
    assert parts["runs/0001/notes0.txt"] == b"a\n[taken out]\nb"


FORMS = (  # as people and libraries write them
    "dx_{0}",
    "SMTP_PASS={0}",
    "Environment=DIRECTRIX_MAIL_PASSWORD={0}",
    "AWS_SECRET_ACCESS_KEY={0}",
    "X-Api-Key: {0}",
    "client_secret={0}",
    "passphrase: '{0} of {0}'",
    "directrix panel --token {0}",
    "Authorization: Bearer {0}",
    "ghp_{0}",
    "eyJhbGciOiJIUzI1NiJ9.{0}.{0}",
    "https://box:{0}@mail.example/in",
    "https://chat.example/services/T02/B07/{0}",
    "https://chat.example/api/webhooks/7/{0}",
    "https://shop.example/in?code={0}",
    "mqtts://shop:{0}@broker.example:8883",
)


class Plants:
    """Each place of a state folder that people write into, by its own text."""

    def __init__(self, state: Path, rng: random.Random) -> None:
        self.state, self._rng, self.secrets = state, rng, list[str]()

    def text(self) -> str:
        """With something in it that lets somebody in."""
        return self._of(FORMS)

    def name(self) -> str:
        """Likewise, of a file."""
        return self._of([form for form in FORMS if "/" not in form])

    def _of(self, forms: Sequence[str]) -> str:
        letters = string.ascii_letters + string.digits
        self.secrets.append("".join(self._rng.choices(letters, k=self._rng.randrange(16, 28))))
        return self._rng.choice(forms).format(self.secrets[-1])

    def plant(self) -> None:
        written = WrittenHistory(self.state)
        self._plant_runs(written)
        written.alarm("NOTICE", message("text", text=self.text()), sender=self.text())
        written.store.put("usage", {"items": {self.text(): {"parts": 7, "note": self.text()}}})
        with contextlib.closing(written.store) as store:
            noted = Requests(store)
            with noted.noted("mdi", {"text": f"({self.text()})"}, AskedBy("anna"), "panel") as hear:
                hear({})
            noted.close()
        setup_data.note(self.state, self._machine())
        facts = recording.Facts(Fault.EMERGENCY_STOP, "", 1, 0, ())
        recording.save(self.state / "recordings", self._machine(), facts, np.zeros((2, len(ROW))), {})
        (self.state / "crashes").mkdir()
        (self.state / "crashes" / "1.txt").write_text(f"{self.text()}\nKeyError: {self.text()!r}\n")

    def _plant_runs(self, written: WrittenHistory) -> None:
        names = [f"{self.name()} {self.name()}.ngc" for _ in range(2)]
        for name in names:
            record = runs.RunRecord(
                self.state, machine_file.load("trunnion"), {"name": name, "note": self.text()}
            )
            (record.folder / "program.ngc").write_text(f"({self.text()})\n(msg, {self.text()})\nM2\n")
            (record.folder / "machine.toml").write_text(self._machine().text)
            (record.folder / f"{self.name()}.txt").write_text(self.text())
            with (record.folder / SETPOINTS.whole).open("wb") as file:
                SETPOINTS.pack(file, 0, np.zeros((4, 5), dtype=np.int32), record.folder.name)
            record.end("completed")
            written.run(name, record=record.folder.name)

    def _machine(self) -> Machine:
        machine = machine_file.load("trunnion")
        return replace(machine, text=f"{machine.text}# {self.text()}\n# {self.text()}\n")


def leaks(folder: Path, rng: random.Random) -> None:
    state = folder / "state"
    with contextlib.closing(Store(state)) as store, store.uploads.begin("b.ngc") as upload:
        upload.write(b"M2\n")
        upload.commit()
    plants = Plants(state, rng)
    plants.plant()
    parts = written(state, folder / "case.zip")
    assert sum(name.startswith("runs/") for name in parts) >= 12 and "machine.toml" in parts
    for name, data in parts.items():
        if name.endswith(".npz"):
            with np.load(io.BytesIO(data)) as packed:
                data = b"".join(str(packed[one]).encode() for one in packed.files)
        found = [one for one in plants.secrets if one.encode() in name.encode() + data]
        assert not found, (SEED, name, found)


def test_what_lets_somebody_in_stays_wherever_it_was_written(tmp_path: Path) -> None:
    leaks(tmp_path, random.Random(f"{SEED}-support"))


@pytest.mark.slow
@pytest.mark.parametrize("part", range(times(40)))
def test_none_of_a_thousand_that_let_somebody_in_goes_along(tmp_path: Path, part: int) -> None:
    leaks(tmp_path, random.Random(f"{SEED}-support-{part}"))


def test_what_is_no_secret_stays(tmp_path: Path) -> None:
    for text in (
        b"G1 X10 (token)\nM2",
        b"https://a.example/b",
        b"a basic operation",
        b'{"position_trusted": true}',
        b'{"password": "", "user": ""}',
        b"T5 (key=hook)",
        b"#<pass>=1.5 (pass 2 of 5) bypass: closed",
        b"https://shop.example/services/",
    ):
        assert redaction.redacted(text, []) == text


def test_a_crash_is_kept_in_the_state_folder_and_goes_along(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = tmp_path / "state"
    state_of_a_shop(state)
    monkeypatch.setenv("STATE_DIRECTORY", str(state))
    for number in range(internal_error.MAX_FILES + 3):
        said = internal_error.sentence(KeyError(f"number {number}"))
        assert str(state / internal_error.FOLDER) in said
    parts = written(state, tmp_path / "case.zip")
    crashes = [data for name, data in parts.items() if name.startswith(internal_error.FOLDER)]
    assert len(crashes) == internal_error.MAX_FILES
    assert sum(f"number {internal_error.MAX_FILES + 2}".encode() in one for one in crashes) == 1


def test_without_a_state_folder_it_is_refused(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["support", str(tmp_path / "x.zip"), "--state", str(tmp_path / "none")])
    assert done.exit_code == 1 and "--state" in done.output and not (tmp_path / "x.zip").exists()
