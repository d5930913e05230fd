"""`texproj preview`: serve the page of one project."""

from __future__ import annotations

import secrets
import socket
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp

from texproj.errors import UsageError
from texproj.options import PreviewOptions
from texproj.preview.app import create_app
from texproj.preview.security import Guard, is_loopback
from texproj.preview.session import Session

GRACE_S = 2
"""How long open streams may take to end when the server stops."""


def guarded_app(session: Session, port: int, token: str | None) -> ASGIApp:
    """The application behind its guard."""
    options = session.options
    return Guard(create_app(session), options.host, port, token, options.max_request_bytes)


def serve(root: Path, options: PreviewOptions) -> None:
    """Serve until interrupted; says on which address. Raises UsageError for a port in use,
    InputError for a project that cannot be opened.
    """
    session = Session(root, options)
    session.facts()
    listener = listen(options.host, options.port)
    port = int(listener.getsockname()[1])
    token = None if is_loopback(options.host) else secrets.token_urlsafe(24)
    app = guarded_app(session, port, token)
    print(address(options.host, port, token), flush=True)  # noqa: T201 - this is the output
    config = uvicorn.Config(
        app, log_level="warning", timeout_graceful_shutdown=GRACE_S, server_header=False
    )
    Server(config, session).run(sockets=[listener])


class Server(uvicorn.Server):
    """uvicorn, ending the event streams before it waits for connections to close."""

    def __init__(self, config: uvicorn.Config, session: Session) -> None:
        super().__init__(config)
        self._session = session

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._session.close()
        await super().shutdown(sockets)


def listen(host: str, port: int) -> socket.socket:
    """A socket on `host`; port 0 = any free one. Raises UsageError if it cannot be had."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise UsageError(
            f"cannot listen on {host} port {port} ({error.strerror}); give another --port"
        ) from None
    return listener


def address(host: str, port: int, token: str | None) -> str:
    """What to open in a browser."""
    name = socket.gethostname() if host in ("0.0.0.0", "::") else host
    name = f"[{name}]" if ":" in name else name
    return f"http://{name}:{port}/" + (f"?token={token}" if token else "")
