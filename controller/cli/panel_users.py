"""``directrix users`` and ``directrix tokens``: who may use the panel, straight in its store.

The first user can be made here only: without users there is nobody who could be asked who
he is, and whoever may write the state folder owns the machine anyway.
"""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer
from rich.table import Table

from controller.cli.speech import Verbs
from controller.ipc import control_socket
from controller.verify.console import Refused, in_words, refusals, say, show

if TYPE_CHECKING:
    from controller.api.store import Store

users = Verbs(no_args_is_help=True)
tokens = Verbs(no_args_is_help=True)


NAME = re.compile(r"[A-Za-z0-9_.@-]{1,40}")
MAX_DAYS = 3650.0
DAY_S = 86400.0


def store_in(folder: Path) -> Store:
    """Raises StoreError."""
    from controller.api.store import Store

    return Store(folder)


@users.command("add")
def add_user(
    name: str, role: Literal["view", "operate", "set_up"] = "set_up", state: Path | None = None
) -> None:
    """Add a user, or give one another password and role. The password is asked for, or read from a pipe."""
    with refusals(False):
        store = store_in(state or control_socket.state_folder())
        _check(name)
        first = not store.users.all()
        if first and role != "set_up":
            raise Refused(say("cli.users.first"))
        store.users.set(name, _hash(_password(name)), role)
        show.print(say("cli.users.first_added" if first else "cli.users.added", name=name, role=role))


@users.command("list")
def list_users(state: Path | None = None) -> None:
    """Users and their roles."""
    with refusals(False):
        table = Table(say("table.user"), say("table.role"), box=None, pad_edge=False)
        for user in store_in(state or control_socket.state_folder()).users.all():
            table.add_row(user.name, user.role)
        show.print(table if table.row_count else say("table.no_users"))


@users.command("remove")
def remove_user(name: str, state: Path | None = None) -> None:
    """Remove a user; without any, only this computer is answered again."""
    with refusals(False):
        store_in(state or control_socket.state_folder()).users.remove(name)
        show.print(say("cli.users.removed", name=name))


@tokens.command("add")
def add_token(
    name: str,
    role: Literal["view", "operate", "set_up"] = "operate",
    days: float | None = None,
    state: Path | None = None,
) -> None:
    """Make a token for a script and print it; it is shown only here."""
    with refusals(False):
        from controller.api.users import new_token

        store = store_in(state or control_socket.state_folder())
        _check(name)
        token, sha256 = new_token()
        if days is not None and not 0.0 < days <= MAX_DAYS:
            raise Refused(say("cli.users.days", days=days, max_days=MAX_DAYS))
        lasts_s = None if days is None else days * DAY_S
        store.users.add_token(sha256, name, role, "command line", lasts_s)
        print(token)


@tokens.command("list")
def list_tokens(state: Path | None = None) -> None:
    """Tokens by name; not what they are."""
    with refusals(False):
        heads = (say(f"table.{head}") for head in ("token", "role", "made_by", "until"))
        table = Table(*heads, box=None, pad_edge=False)
        for token in store_in(state or control_socket.state_folder()).users.tokens():
            table.add_row(token.name, token.role, token.made_by, _until(token.expires_s))
        show.print(table if table.row_count else say("table.no_tokens"))


@tokens.command("remove")
def remove_token(name: str, state: Path | None = None) -> None:
    """Its script is refused from now on."""
    with refusals(False):
        store_in(state or control_socket.state_folder()).users.remove_token(name)
        show.print(say("cli.users.removed", name=name))


def _until(expires_s: float | None) -> str:
    return "" if expires_s is None else time.strftime("%Y-%m-%d %H:%M", time.localtime(expires_s))


def _check(name: str) -> None:
    if not NAME.fullmatch(name):
        raise Refused(say("cli.users.name", name=name))


def _password(name: str) -> str:
    from controller.api import passwords

    if sys.stdin.isatty():
        password: str = typer.prompt(say("cli.users.password"), hide_input=True)
        if password != typer.prompt(say("cli.users.again"), hide_input=True):
            raise Refused(say("cli.users.not_the_same"))
    else:
        password = sys.stdin.readline().rstrip("\r\n")
    if (why := passwords.check(password, [name])) is not None:
        raise Refused(in_words(why))
    return password


def _hash(password: str) -> str:
    from argon2 import PasswordHasher

    return PasswordHasher().hash(password)
