"""The bench over HTTP and a WebSocket."""

from __future__ import annotations

import asyncio
import hmac
import json
import logging
import math
import secrets
import struct
import time as clock
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.resources import files
from threading import Lock
from typing import TYPE_CHECKING, Any, Protocol
from urllib.parse import urlsplit

import numpy as np
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from elevon.documents import check_depth
from elevon.errors import ElevonError, InputError
from elevon.live.loop import SampleRing
from elevon.plain import plain
from elevon.results import finite

if TYPE_CHECKING:
    from pathlib import Path

    from elevon.live.loop import LiveLoop


_LOG = logging.getLogger(__name__)
MOST_BYTES = 64 * 1024
"""Of a message."""
_LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})

#: Nothing from elsewhere, no inline script; styles of its own sheet.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


@dataclass(frozen=True)
class Guard:
    """The rules of one server.

    Attributes
    ----------
    host : str
        Address it listens on.
    token : str
        Asked for on every address; empty: none.
    """

    host: str = "127.0.0.1"
    token: str = ""

    @property
    def local(self) -> bool:
        """Whether only this machine can reach the server."""
        return self.host in _LOOPBACK

    def refuses(self, headers: Mapping[str, str], token: str) -> tuple[int, str] | None:
        """Return status and reason of a refusal; None where a request is not refused.

        A page of another site may send requests to this machine: the browser names its origin, and
        the name it used for this server.
        """
        host, origin = headers.get("host", ""), headers.get("origin")
        try:
            name = urlsplit(f"//{host}").hostname or ""
            place = host if origin is None else urlsplit(origin).netloc
        except ValueError:
            return 400, f"host {host!r:.60} or origin {origin!r:.60} is malformed"
        if self.local and name not in _LOOPBACK:
            return 403, f"host {host!r:.60} is not this machine"
        if place != host:
            return 403, f"origin {origin!r:.60} is not this page"
        if self.token and not hmac.compare_digest(token.encode(), self.token.encode()):
            return (
                403,
                "the token is missing or wrong: it stands in the link that elevon live prints",
            )
        return None


def message_of(text: str | bytes) -> dict[str, object]:
    """Read one JSON object.

    Raises
    ------
    InputError
        Longer than 64 KiB, no JSON, no object, NaN, nested too deeply.
    """
    if len(text) > MOST_BYTES:
        raise InputError(f"a message of {len(text)} bytes; at most {MOST_BYTES}")
    try:
        read = json.loads(
            text,
            parse_constant=_refused,
            parse_float=_finite,
            parse_int=lambda digits: int(_short(digits)),
        )
    except (ValueError, RecursionError) as error:
        raise InputError(f"no JSON: {str(error)[:80]}") from error
    if not isinstance(read, dict):
        raise InputError(f"a JSON object is expected, not {type(read).__name__}")
    check_depth(read, "message")
    return read


def _refused(name: str) -> float:
    raise ValueError(f"{name} is no number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:20]} is beyond floats")
    return value


def _short(digits: str) -> str:
    if len(digits) > 18:
        raise ValueError(f"{digits[:20]}... is too long a whole number")
    return digits


_IDLE = 60.0  # s after which another viewer may take over


class ControlError(ElevonError):
    """Somebody else has the bench."""

    exit_code = 2


class Control:
    """The viewers that are connected, and which of them has control."""

    def __init__(self) -> None:
        self._viewers: set[str] = set()
        self._holder = ""
        self._last = 0.0
        self._lock = Lock()

    @property
    def holder(self) -> str:
        """The viewer in control; empty: none."""
        return self._holder

    @property
    def viewers(self) -> int:
        """How many are connected."""
        return len(self._viewers)

    def join(self) -> str:
        """Return the name of a new viewer."""
        name = secrets.token_urlsafe(9)
        with self._lock:
            self._viewers.add(name)
        return name

    def leave(self, name: str) -> None:
        """Remove a viewer; control that it held becomes free."""
        with self._lock:
            self._viewers.discard(name)
            if self._holder == name:
                self._holder = ""

    def release(self, name: str) -> None:
        """Give control up."""
        with self._lock:
            if self._holder == name:
                self._holder = ""

    def claim(self, name: str) -> None:
        """Take control where nobody has it, or has not used it for a minute.

        Parameters
        ----------
        name : str
            A viewer; empty or unknown: a program, which acts where no viewer has control and holds
            nothing.

        Raises
        ------
        ControlError
            A viewer has it.
        """
        with self._lock:
            now = clock.monotonic()
            busy = bool(self._holder) and now - self._last < _IDLE
            if self._holder and self._holder != name and (busy or name not in self._viewers):
                raise ControlError("another viewer has control; it is free when that one leaves")
            if name in self._viewers:
                self._holder, self._last = name, now


RATE = 30.0
"""Snapshots a second."""
MOST_ROWS = 96
"""Rows of a snapshot: more samples are thinned to them."""
_HEAD = struct.Struct("<ddfIII")


class SharedFrames:
    """What viewers have in common: each snapshot and each state is encoded once for all.

    Parameters
    ----------
    ring : SampleRing
        Where samples come from.
    state : callable
        Returns the bench's state as text.
    """

    def __init__(self, ring: SampleRing, state: Callable[[], str]) -> None:
        self.ring = ring
        self._state = state
        self._tick, self._noted = -1.0, -1
        self._last = ring.written
        self._text = ""
        self._bodies: dict[tuple[int, tuple[int, ...]], tuple[int, bytes]] = {}

    def at(self, tick: float) -> int:
        """Move to a picture number; return the number of the last sample that it holds."""
        if tick != self._tick:
            self._tick, self._last = tick, self.ring.written
            self._bodies.clear()
        return self._last

    def state(self, number: int) -> str:
        """Return the state as text, encoded again when its number has changed."""
        if number != self._noted:
            self._noted, self._text = number, self._state()
        return self._text

    def body(self, first: int, columns: tuple[int, ...]) -> tuple[int, bytes]:
        """Return the encoded rows from a sample to the last of the picture, and their number."""
        key = (first, columns)
        if key not in self._bodies:
            times, values = self.ring.between(first, self._last, columns, MOST_ROWS)
            packed = times.astype("<f8").tobytes() + values.astype(np.dtype("<f4")).tobytes()
            self._bodies[key] = (len(times), packed)
        return self._bodies[key]


class SnapshotWriter:
    """Packs the new samples of a ring for one viewer.

    A snapshot holds, little-endian: time [s] and factor as float64, the factor asked for as
    float32, then as uint32 the number of the choice of signals, rows and columns; then the rows'
    instants as float64 and their values as float32, row by row.

    Parameters
    ----------
    frames : SharedFrames
        Where samples come from.
    """

    def __init__(self, frames: SharedFrames) -> None:
        self._frames = frames
        self._next = frames.ring.written
        self._columns: tuple[int, ...] = ()
        self._choice = 0

    def choose(self, names: Sequence[str], choice: int) -> None:
        """Select the signals sent from now on; unknown ones are left out."""
        self._columns, self._choice = tuple(self._frames.ring.columns(names)), choice

    def pack(self, tick: float, time: float, factor: float, wanted: float) -> bytes:
        """Return the snapshot of the samples since the last one, for a picture number."""
        last = self._frames.at(tick)
        rows, body = self._frames.body(self._next, self._columns)
        self._next = last
        head = _HEAD.pack(time, factor, wanted, self._choice, rows, len(self._columns))
        return head + body


_STATE = 6  # snapshots to a state
_SEND = 20.0  # s in which a viewer must take a snapshot
_MOST_SIGNALS = 64  # of one viewer
_SAMPLE = 0.006  # s in which the simulation has gone on by a sample, at real time
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css",
          ".svg": "image/svg+xml"}  # fmt: skip
_HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
}


class Exhibit(Protocol):
    """What the server needs of a bench or of a replayed log."""

    loop: LiveLoop
    files: list[Path]

    def describe(self) -> dict[str, object]:
        """Return the constant description."""
        ...

    def state(self) -> dict[str, object]:
        """Return the present state."""
        ...

    def act(self, message: Mapping[str, object]) -> dict[str, object]:
        """Carry out the action of a message."""
        ...


class ActBell:
    """Signals to waiting viewers that an action is done and one sample has followed."""

    def __init__(self) -> None:
        self._waiting: set[asyncio.Future[None]] = set()

    def done(self) -> None:
        """Signal one sample later."""
        asyncio.get_running_loop().call_later(_SAMPLE, self._ring)

    def _ring(self) -> None:
        for future in self._waiting:
            if not future.done():
                future.set_result(None)

    async def within(self, seconds: float) -> bool:
        """Wait for it; False where it has not come in time."""
        future = asyncio.get_running_loop().create_future()
        self._waiting.add(future)
        try:
            await asyncio.wait_for(future, max(0.0, seconds))
        except TimeoutError:
            return False
        finally:
            self._waiting.discard(future)
        return True


#: What is raised on a connection whose peer has gone.
_VANISHED = (WebSocketDisconnect, RuntimeError, OSError)


class Quiet:
    """An application whose errors are a line each on the log, never a traceback.

    Parameters
    ----------
    routes : sequence
        What it answers.
    """

    def __init__(self, routes: Sequence[BaseRoute]) -> None:
        self._app = Starlette(routes=routes)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request or serve a socket; an error in it has had the status 500."""
        try:
            await self._app(scope, receive, send)
        except Exception as error:  # noqa: BLE001 - of whatever kind: it ends here
            if not isinstance(error, _VANISHED):
                place = f"{scope['type']} {scope.get('path', '')!r:.80}"
                _LOG.error("live: %s: %s: %s", place, type(error).__name__, error)


class LiveApp:
    """Routes of one bench.

    Parameters
    ----------
    bench : Exhibit
        What is shown and moved.
    guard : Guard
        Who may ask.
    """

    def __init__(self, bench: Exhibit, guard: Guard) -> None:
        self.bench, self.guard, self.control = bench, guard, Control()
        self._acts = ActBell()
        self._frames = SharedFrames(bench.loop.ring, lambda: _text(self._now()))
        self.asgi = Quiet(
            [
                Route("/", self._page),
                Route("/page/{name}", self._page),
                Route("/model", self._model),
                Route("/state", self._state),
                Route("/act", self._act, methods=["POST"]),
                Route("/files/{name}", self._file),
                WebSocketRoute("/stream", self._stream),
            ]
        )

    def _refused(self, request: Request) -> JSONResponse | None:
        refusal = self.guard.refuses(request.headers, _token(request))
        return None if refusal is None else _answer({"error": refusal[1]}, refusal[0])

    async def _page(self, request: Request) -> Response:
        refusal = Guard(self.guard.host).refuses(request.headers, "")
        if refusal is not None:
            return _answer({"error": refusal[1]}, refusal[0])
        file = asset(request.path_params.get("name", "index.html"))
        if file is None:
            return _answer({"error": "no such page"}, 404)
        data, kind = file
        return Response(data, media_type=kind, headers=_HEADERS)

    async def _model(self, request: Request) -> Response:
        return self._refused(request) or _answer(self.bench.describe())

    async def _state(self, request: Request) -> Response:
        return self._refused(request) or _answer(self._now())

    async def _act(self, request: Request) -> Response:
        refused = self._refused(request)
        if refused is not None:
            return refused
        try:
            message = message_of(await _body(request))
            return _answer(await self._done(message, request.headers.get("x-viewer", "")))
        except ControlError as error:
            return _answer({"error": str(error)}, 409)
        except ElevonError as error:
            return _answer({"error": str(error)}, 400)

    async def _done(self, message: dict[str, Any], viewer: str) -> dict[str, Any]:
        if message.pop("release", False):
            self.control.release(viewer)
            return {"control": False}
        self.control.claim(viewer)
        answer = await asyncio.to_thread(self.bench.act, message)
        self._acts.done()
        return {**answer, "control": self.control.holder == viewer}

    async def _file(self, request: Request) -> Response:
        refused = self._refused(request)
        if refused is not None:
            return refused
        for path in self.bench.files:
            if path.name == request.path_params["name"] and path.is_file():
                return FileResponse(path, filename=path.name, headers=_HEADERS)
        return _answer({"error": "no such recording"}, 404)

    def _now(self) -> dict[str, Any]:
        control = {"held": bool(self.control.holder), "viewers": self.control.viewers}
        return {**self.bench.state(), "control": control}

    async def _stream(self, socket: WebSocket) -> None:
        refusal = self.guard.refuses(socket.headers, _token(socket))
        with suppress(*_VANISHED):
            if refusal is not None:
                await socket.send_denial_response(_answer({"error": refusal[1]}, refusal[0]))
                return
            await socket.accept()
            await self._accepted(socket)

    async def _accepted(self, socket: WebSocket) -> None:
        name = self.control.join()
        writer = SnapshotWriter(self._frames)
        tasks = {
            asyncio.create_task(self._send(socket, name, writer)),
            asyncio.create_task(self._receive(socket, name, writer)),
        }
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.control.leave(name)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        await socket.close()

    async def _send(self, socket: WebSocket, name: str, writer: SnapshotWriter) -> None:
        """Send snapshots as fast as the viewer takes them, thirty a second at most.

        Each is made when the one before has gone: nothing queues, what is missed is thinned.
        All viewers are served at the same instants, so that what they have in common is made once.
        """
        loop, wall = self.bench.loop, asyncio.get_running_loop().time
        with suppress(*_VANISHED, TimeoutError):
            await _within(socket.send_text(_text({"viewer": name})))
            noted, tick = -1, float(int(wall() * RATE))
            while True:
                if int(tick) // _STATE != noted:
                    noted = int(tick) // _STATE
                    mine = json.dumps(self.control.holder == name)
                    state = self._frames.state(noted)
                    await _within(socket.send_text(f'{{"mine": {mine}, "state": {state}}}'))
                packed = writer.pack(tick, loop.source.time, loop.reached_factor, loop.factor)
                await _within(socket.send_bytes(packed))
                due = int(tick) + 1
                acted = await self._acts.within(due / RATE - wall())
                # What an act has brought about is sent at once, one picture between two.
                tick = tick + 0.5 if acted and tick.is_integer() else await _until(due)

    async def _receive(self, socket: WebSocket, name: str, writer: SnapshotWriter) -> None:
        """Take messages of a viewer: its choice of signals, and acts as `/act` has them."""
        with suppress(*_VANISHED, KeyError):
            while True:
                received = await socket.receive()
                if received["type"] == "websocket.disconnect":
                    return
                text = received.get("text")
                answer = await self._heard(text if text is not None else "", name, writer)
                if answer is not None:
                    await _within(socket.send_text(_text(answer)))

    async def _heard(self, text: str, name: str, writer: SnapshotWriter) -> dict[str, Any] | None:
        try:
            message = message_of(text)
            if "watch" in message:
                writer.choose(*_choice(message))
                return None
            return await self._done(message, name)
        except ElevonError as error:
            return {"error": str(error)}


def asset(name: str) -> tuple[bytes, str] | None:
    """Return a file of the page and its type: our own ones, and the plots' library as it is."""
    vendored = {"uplot.js": "uPlot.iife.min.js", "uplot.css": "uPlot.min.css"}
    ending = name[name.rfind(".") :]
    if ending not in _TYPES or "/" in name or name.startswith("."):
        return None
    folder = (
        files("elevon.report") / "vendor" if name in vendored else files("elevon.live") / "page"
    )
    wanted = vendored.get(name, name)
    matching = [file for file in folder.iterdir() if file.name == wanted]
    return (matching[0].read_bytes(), _TYPES[ending]) if matching else None


async def _body(request: Request) -> bytes:
    """Return a request's body, of bounded length."""
    out = bytearray()
    async for part in request.stream():
        out += part
        if len(out) > MOST_BYTES:
            raise InputError(f"a message of more than {MOST_BYTES} bytes")
    return bytes(out)


def _choice(message: Mapping[str, Any]) -> tuple[list[str], int]:
    names, number = message["watch"], message.get("choice", 0)
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise InputError("watch: a list of signals is expected")
    if len(names) > _MOST_SIGNALS:
        raise InputError(f"watch: {len(names)} signals; at most {_MOST_SIGNALS}")
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < 2**32:
        raise InputError("watch: choice is no small whole number")
    return names, number


def _token(request: Request | WebSocket) -> str:
    given = request.headers.get("x-elevon-token") or request.query_params.get("token", "")
    return str(given)


async def _until(tick: int) -> float:
    """Wait for a picture's instant; its number, or that of a later one where it has passed."""
    wall = asyncio.get_running_loop().time
    await asyncio.sleep(max(0.0, tick / RATE - wall()))
    return float(max(tick, int(wall() * RATE)))


async def _within(sent: Awaitable[None]) -> None:
    await asyncio.wait_for(sent, _SEND)


def _text(value: Mapping[str, Any]) -> str:
    return json.dumps(finite(plain(value)), allow_nan=False)


def _answer(value: Mapping[str, Any], status: int = 200) -> JSONResponse:
    return JSONResponse(finite(plain(value)), status, headers=_HEADERS)
