"""``directrix panel``, ``users`` and ``tokens``: what they refuse, and what they leave in the store."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from controller.__main__ import app
from controller.api.connections import Connections
from controller.api.sessions import sha256
from controller.api.store import Store

PASSWORD = "correct horse\n"


def run(*words: str, typed: str = "") -> Result:
    return CliRunner().invoke(app, list(words), input=typed)


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What the web server would have been given."""
    given: list[dict[str, Any]] = []

    def note(_: Connections, application: Any, **options: Any) -> None:
        application.state.panel.checker.close()
        given.append(options)

    monkeypatch.setattr(Connections, "serve", note)
    return given


def test_the_panel_listens_on_this_computer_alone_unless_told_otherwise(
    tmp_path: Path, served: list[dict[str, Any]]
) -> None:
    done = run("panel", "--state", str(tmp_path), "--runtime", str(tmp_path))
    assert done.exit_code == 0, done.output
    assert (served[0]["host"], served[0]["port"], served[0]["proxy_headers"]) == ("127.0.0.1", 8080, False)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "::", "machine.example"])
def test_beyond_this_computer_users_are_needed_and_then_tls(
    tmp_path: Path, served: list[dict[str, Any]], host: str
) -> None:
    where = ("--state", str(tmp_path), "--runtime", str(tmp_path))
    refused = run("panel", "--host", host, *where)
    assert refused.exit_code == 1
    assert "users are needed" in refused.output.replace("\n", " ")
    assert run("users", "add", "anna", "--state", str(tmp_path), typed=PASSWORD).exit_code == 0
    refused = run("panel", "--host", host, *where)
    assert refused.exit_code == 1
    assert "need TLS" in refused.output.replace("\n", " ")
    assert not served
    assert run("panel", "--host", host, "--proxy", "127.0.0.1", *where).exit_code == 0
    assert served[0]["forwarded_allow_ips"] == "127.0.0.1"


def test_a_certificate_that_is_not_there_is_refused_before_anything_listens(
    tmp_path: Path, served: list[dict[str, Any]]
) -> None:
    refused = run("panel", "--state", str(tmp_path), "--tls-certificate", str(tmp_path / "no.pem"))
    assert refused.exit_code == 1
    assert "no such file" in refused.output.replace("\n", " ")
    assert not served


def test_the_first_user_sets_up_and_passwords_are_kept_as_hashes(tmp_path: Path) -> None:
    state = ("--state", str(tmp_path))
    assert "first user" in run("users", "add", "anna", "--role", "view", *state, typed=PASSWORD).output
    assert "From now on" in run("users", "add", "anna", *state, typed=PASSWORD).output
    assert run("users", "add", "otto", "--role", "operate", *state, typed=PASSWORD).exit_code == 0
    assert "otto" in run("users", "list", *state).output
    found = {user.name: user for user in Store(tmp_path).users.all()}
    assert {name: user.role for name, user in found.items()} == {"anna": "set_up", "otto": "operate"}
    assert all(user.password.startswith("$argon2id$") for user in found.values())
    assert run("users", "remove", "otto", *state).exit_code == 0
    assert run("users", "remove", "otto", *state).exit_code == 1


@pytest.mark.parametrize(
    ("words", "typed", "why"),
    [
        (("users", "add", "anna"), "short\n", "allowed are 8 to 200"),
        (("users", "add", "an na"), PASSWORD, "is no name"),
        (("tokens", "add", "../cam"), "", "is no name"),
        (("tokens", "remove", "cam"), "", "no such token"),
    ],
)
def test_what_is_wrong_is_refused_in_a_sentence(
    tmp_path: Path, words: tuple[str, ...], typed: str, why: str
) -> None:
    refused = run(*words, "--state", str(tmp_path), typed=typed)
    assert refused.exit_code == 1
    assert why in refused.output.replace("\n", " ")


def test_a_token_is_shown_once_and_kept_as_its_hash(tmp_path: Path) -> None:
    token = run("tokens", "add", "cam", "--state", str(tmp_path)).output.strip()
    assert token.startswith("dx_")
    kept = Store(tmp_path).users.token(sha256(token))
    assert kept is not None and (kept.name, kept.role) == ("cam", "operate")
    assert token not in run("tokens", "list", "--state", str(tmp_path)).output
