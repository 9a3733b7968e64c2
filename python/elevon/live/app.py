"""The bench over HTTP and a WebSocket."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Mapping
from contextlib import suppress
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Protocol

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from elevon.errors import ElevonError, InputError
from elevon.live.control import Control, ControlError
from elevon.live.frames import RATE, SharedFrames, SnapshotWriter
from elevon.live.guard import MOST_BYTES, POLICY, Guard, message_of
from elevon.plain import plain
from elevon.results import finite

if TYPE_CHECKING:
    from pathlib import Path

    from elevon.live.loop import LiveLoop


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
    """What the server needs of a bench or of a log that is played."""

    loop: LiveLoop
    files: list[Path]

    def describe(self) -> dict[str, object]:
        """Return what does not change."""
        ...

    def state(self) -> dict[str, object]:
        """Return how it stands."""
        ...

    def act(self, message: Mapping[str, object]) -> dict[str, object]:
        """Do what a message says."""
        ...


class ActBell:
    """Tells whoever waits that an act has been done, and one sample since."""

    def __init__(self) -> None:
        self._waiting: set[asyncio.Future[None]] = set()

    def done(self) -> None:
        """Ring, a sample later."""
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
        self.asgi = Starlette(
            routes=[
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
        reason = self.guard.refuses(request.headers, _token(request))
        return None if reason is None else _answer({"error": reason}, 403)

    async def _page(self, request: Request) -> Response:
        reason = Guard(self.guard.host).refuses(request.headers, "")
        if reason is not None:
            return _answer({"error": reason}, 403)
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
        if self.guard.refuses(socket.headers, _token(socket)) is not None:
            await socket.close(code=4403)
            return
        await socket.accept()
        name = self.control.join()
        writer = SnapshotWriter(self._frames)
        tasks = {
            asyncio.create_task(self._send(socket, name, writer)),
            asyncio.create_task(self._receive(socket, name, writer)),
        }
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            self.control.leave(name)
            with suppress(RuntimeError):
                await socket.close()

    async def _send(self, socket: WebSocket, name: str, writer: SnapshotWriter) -> None:
        """Send snapshots as fast as the viewer takes them, thirty a second at most.

        Each is made when the one before has gone: nothing queues, what is missed is thinned.
        All viewers are served at the same instants, so that what they have in common is made once.
        """
        loop, wall = self.bench.loop, asyncio.get_running_loop().time
        with suppress(WebSocketDisconnect, RuntimeError, TimeoutError, OSError):
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
        with suppress(WebSocketDisconnect, RuntimeError, KeyError):
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
    if name in vendored:
        file = files("elevon.report") / "vendor" / vendored[name]
    else:
        file = files("elevon.live") / "page" / name
    return (file.read_bytes(), _TYPES[ending]) if file.is_file() else None


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
    given = request.headers.get("x-token") or request.query_params.get("token", "")
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
