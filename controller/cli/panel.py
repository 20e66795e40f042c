"""``directrix panel``: the REST interface of a machine, as an unprivileged process of its own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from controller import journald
from controller.ipc import control_socket
from controller.runtime import cores
from controller.verify.console import Refused, in_words, refusals, say, tell

if TYPE_CHECKING:
    from controller.api.store import Store


CLOSE_S = 3  # for requests under way, at the end


def panel(
    host: str = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535)] = 8080,
    state: Path | None = None,
    runtime: Path | None = None,
    tls_certificate: Path | None = None,
    tls_key: Path | None = None,
    proxy: str = "",
    page: bool = True,
    anybody_stops: Annotated[bool, typer.Option("--anybody-may-stop")] = False,
) -> None:
    """Serve programs, status and control of a machine over HTTP; it may end and come back at any time."""
    from controller.cli import panel_users

    journald.use()
    with refusals(False):
        try:
            from controller.api.access import is_loopback
            from controller.api.connections import Connections, Limits, raise_file_limit
        except ImportError as error:
            raise Refused(say("cli.panel.no_packages", why=error)) from error
        store = panel_users.store_in(state or control_socket.state_folder())
        if not is_loopback(host):
            _may_leave(host, bool(store.users.all()), tls_certificate is not None, bool(proxy))
        for file in (tls_certificate, tls_key):
            if file is not None and not file.is_file():
                raise Refused(say("cli.panel.no_certificate", file=file))
        if (lost := store.users.lost) is not None:
            tell.print(in_words(lost))
            store.report(lost)
        socket = control_socket.control_path(runtime or control_socket.runtime_folder())
        cores.leave()
        connections = Connections(Limits.within(raise_file_limit()))
        tell.print(say("cli.panel.serves", host=host, port=port, socket=socket, folder=store.folder))
        connections.serve(
            _app(store, socket, page, anybody_stops, tls_certificate is not None),
            host=host,
            port=port,
            log_level="warning",
            **({"log_config": None} if journald.in_use() else {}),  # else uvicorn's own format
            access_log=False,  # the audit log says who changed what
            server_header=False,
            proxy_headers=bool(proxy),
            forwarded_allow_ips=proxy or None,
            ssl_certfile=tls_certificate,
            ssl_keyfile=tls_key,
            timeout_graceful_shutdown=CLOSE_S,
        )


def _may_leave(host: str, users: bool, certificate: bool, proxy: bool) -> None:
    """Beyond this computer: never without users, never with passwords in the clear. Raises Refused."""
    if not users:
        raise Refused(say("cli.panel.no_users", host=host))
    if not certificate and not proxy:
        raise Refused(say("cli.panel.no_tls", host=host))


def _app(
    store: Store, socket: Path, page: bool = True, anybody_stops: bool = False, by_tls: bool = False
) -> Any:
    from controller.api.app_state import Panel
    from controller.api.checker import Checker
    from controller.api.http import make_app
    from controller.api.service_client import SocketServiceClient
    from controller.web.server import add_page

    store.sweep()
    made = Panel(store, SocketServiceClient(socket), Checker(store), anybody_stops, by_tls)
    app = make_app(made)
    if page:
        add_page(app)
    return app
