"""The REST interface as the client verbs use it: one address, one token, sentences where it refuses.

Nothing of the controller is needed to speak to a machine, so this runs on any computer:

    with remote.connected(url, token) as machine:
        machine.get("status")
        with machine.control():
            machine.post("start")

The token of control is taken for a command and given back at its end; whoever had it
before keeps it unless the command asks for taking it over.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import sys
from collections.abc import Iterator, Mapping
from types import ModuleType
from typing import TYPE_CHECKING, Any

from controller.cli import speech
from controller.cli.speech import say
from controller.ipc.control_socket import state_folder
from controller.verify.console import Refused

if TYPE_CHECKING:
    import httpx

API = "/api/v1/"
URL = "http://127.0.0.1:8080"
TIMEOUT_S = 150.0  # homing, reading a program: the panel itself gives up after two minutes
CONNECT_S = 5.0
CONTROL = "X-Control-Token"


class Machine:
    """A panel, by an HTTP client whose base address is its own."""

    def __init__(self, http: httpx.Client) -> None:
        self._http = http

    def get(self, path: str, **query: Any) -> Any:
        """The answer's value. Raises Refused with the sentence of whoever refused."""
        return self._ask("GET", path, params={k: v for k, v in query.items() if v is not None})

    def post(self, path: str, values: Mapping[str, Any] | None = None, **more: Any) -> Any:
        """Likewise; ``values`` go as JSON, ``more`` as httpx has it (files, ...)."""
        return self._ask("POST", path, **(more if values is None else {**more, "json": dict(values)}))

    def put(self, path: str, values: Mapping[str, Any]) -> Any:
        return self._ask("PUT", path, json=dict(values))

    def delete(self, path: str) -> Any:
        return self._ask("DELETE", path)

    @contextlib.contextmanager
    def control(self, take_over: bool = False) -> Iterator[None]:
        """Hold the control token meanwhile."""
        try:
            token = self.post("control", {"take_over": take_over})["token"]
        except Refused as refused:
            if refused.facts.get("code") != "control":
                raise
            whose = self.get("control")["holder"] or say("somebody")
            raise Refused(say("control_held", holder=whose), **refused.facts) from refused
        self._http.headers[CONTROL] = token
        try:
            yield
        finally:
            with contextlib.suppress(Refused):  # it may have been taken over meanwhile
                self._ask("DELETE", "control")
            del self._http.headers[CONTROL]

    def _ask(self, method: str, path: str, **more: Any) -> Any:
        library = _httpx()
        try:
            answer = self._http.request(method, API + path, headers=speech.header(), **more)
        except library.TimeoutException as error:
            raise Refused(say("late", url=self._http.base_url)) from error
        except (library.HTTPError, library.InvalidURL) as error:
            raise Refused(say("gone", url=self._http.base_url, why=error)) from error
        if answer.is_success:
            if answer.headers.get("content-type", "").startswith("text/csv"):
                return answer.text
            return answer.json() if answer.content else None
        raise _refused(answer)


@contextlib.contextmanager
def connected(url: str, token: str) -> Iterator[Machine]:
    """A machine at an address. Raises Refused where httpx is not installed or the address is none."""
    if not url.startswith(("http://", "https://")):
        raise Refused(say("bad_url", url=url))
    with client(url, {"Authorization": f"Bearer {token}"} if token else {}) as http:
        yield Machine(http)


def client(url: str, headers: Mapping[str, str], own: bool = False) -> httpx.Client:
    """What connects. Proxies of the environment are not for machines: the panel refuses them.

    ``own``: the address is that of the panel which has started this process, whatever its certificate names.
    """
    try:
        library = _httpx()
    except ImportError as error:
        raise Refused(say("no_httpx")) from error
    limits = library.Timeout(TIMEOUT_S, connect=CONNECT_S)
    made: httpx.Client = library.Client(
        base_url=url, headers=dict(headers), timeout=limits, mounts={"all://": None}, verify=not own
    )
    return made


def _httpx() -> ModuleType:
    """Without its own command line, which would cost more than all the rest of a verb."""
    sys.modules.setdefault("httpx._main", None)  # type: ignore[arg-type]
    return importlib.import_module("httpx")


def known_token() -> str:
    """A script's token: of the environment, or of the file ``token`` in the user's state folder."""
    if given := os.environ.get("DIRECTRIX_TOKEN", ""):
        return given.strip()
    with contextlib.suppress(OSError):
        return (state_folder() / "token").read_text(encoding="utf-8").strip()
    return ""


def _refused(answer: httpx.Response) -> Refused:
    """The sentence of an error answer, with what else it says for --json."""
    try:
        said = answer.json()
    except (json.JSONDecodeError, UnicodeDecodeError):
        said = None
    facts = said.get("error") if isinstance(said, dict) else None
    if not isinstance(facts, dict) or "sentence" not in facts:
        where = f"{answer.request.method} {answer.request.url}"
        return Refused(say("no_reason", asked=where, status=answer.status_code))
    told = {name: facts[name] for name in ("code", "mode", "request") if facts.get(name)}
    return Refused(str(facts["sentence"]), status=answer.status_code, **told)
