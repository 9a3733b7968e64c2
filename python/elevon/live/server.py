"""The server's process: its socket, its thread of simulation, its end."""

from __future__ import annotations

import errno
import secrets
import socket
import webbrowser
from collections.abc import Callable
from threading import Timer
from typing import TYPE_CHECKING

from elevon.errors import InputError
from elevon.live.app import Guard

if TYPE_CHECKING:
    from elevon.live.bench import LiveBench
    from elevon.live.replay import LogReplay


def serve(
    bench: LiveBench | LogReplay,
    *,
    port: int = 0,
    host: str = "127.0.0.1",
    browser: bool = True,
    token: bool = True,
    ready: Callable[[str, str], None],
) -> None:
    """Show a bench until Ctrl-C.

    Parameters
    ----------
    bench : LiveBench or LogReplay
        What is shown.
    port : int
        0: a free one.
    host : str
        Address to listen on.
    browser : bool
        Whether the page is opened.
    token : bool
        Whether the server asks for the token of its address: without, each account of this machine
        (and, beyond loopback, of the network) may act and record.
    ready : callable
        Told the address, and its token, once it answers.

    Raises
    ------
    InputError
        A port that is taken or not allowed, an address of another machine.
    """
    import uvicorn

    from elevon.live.app import LiveApp

    bound = _bound(host, port)
    guard = Guard(host, secrets.token_urlsafe(16) if token else "")
    app = LiveApp(bench, guard)
    server = uvicorn.Server(
        uvicorn.Config(
            app.asgi, log_level="warning", access_log=False, ws="websockets-sansio",
            ws_max_size=128 * 1024, ws_per_message_deflate=False, timeout_graceful_shutdown=1,
            lifespan="off",
        )
    )  # fmt: skip
    address = _address(host, bound.getsockname()[1], guard.token)
    bench.start()
    try:
        ready(address, guard.token)
        if browser:
            Timer(0.3, webbrowser.open, [address]).start()
        server.run(sockets=[bound])
    finally:
        bench.stop()
        bound.close()


def _bound(host: str, port: int) -> socket.socket:
    """Return a socket that listens."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bound = socket.socket(family, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((host, port))
        bound.listen(128)
    except (OSError, OverflowError) as error:
        bound.close()
        if isinstance(error, OverflowError):
            raise InputError(f"--port {port}: must be 0 to 65535") from error
        if error.errno == errno.EADDRINUSE:
            raise InputError(
                f"--port {port}: something listens there; --port 0 takes a free one"
            ) from error
        raise InputError(f"{host}, port {port}: {error.strerror}") from error
    return bound


def _address(host: str, port: int, token: str) -> str:
    name = f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}/" + (f"?token={token}" if token else "")
