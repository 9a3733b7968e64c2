"""What the server promises: its first line, /state, /act, its limits, who may speak to it."""

import asyncio
import json
import os
import re
import signal
import socket
import struct
import time

import pytest
from starlette.routing import Route
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from elevon.cli import main
from elevon.live.app import Quiet
from tests.live.browser import browser, needs_browser, opened, press, until
from tests.live.serving import SINE, bench

STREAM = "stream"
UPGRADE = (
    b"\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13"
    b"\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="
)
PICTURE = "document.querySelector('#picture').innerHTML"


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    folder = tmp_path_factory.mktemp("live")
    with bench("--fidelity", "low", "--factor", "10", folder=folder) as server:
        yield server


def _socket(live, **options):
    address = f"{live.address.replace('http', 'ws')}{STREAM}?token={live.token}"
    return connect(address, compression=None, **options)


def test_the_first_line_is_the_address(live):
    assert re.fullmatch(r"live at http://127\.0\.0\.1:\d+/\?token=[\w-]{22}\n", live.line)


def test_the_first_line_is_json_where_that_is_asked_for(tmp_path):
    with bench("--fidelity", "low", "--json", folder=tmp_path) as server:
        about = json.loads(server.line)
    assert about["url"].endswith(f"/?token={about['token']}")
    assert (about["status"], len(about["token"])) == ("ok", 22)


def test_without_the_token_nothing_is_told_or_done(live):
    """Another account of a shared machine reaches the port as well."""
    for path, data in (("state", None), ("model", None), ("act", {"record": True})):
        assert live.request(path, data, token=False)[0] == 403
        assert live.request(f"{path}?token=", data, token=False)[0] == 403
        assert live.request(path, data, {"X-Elevon-Token": "x" * 22}, token=False)[0] == 403
    assert live.request(f"state?token={live.token}", token=False)[0] == 200
    with pytest.raises(InvalidStatus, match="403"):
        connect(live.address.replace("http", "ws") + STREAM, compression=None)


def test_a_server_that_asks_for_no_token(tmp_path):
    with bench("--fidelity", "low", "--no-token", folder=tmp_path) as server:
        assert server.line.endswith("/\n")
        assert server.request("state", token=False)[0] == 200


@pytest.mark.parametrize(
    ("head", "status"),
    [
        (b"Host: [::1", 400),
        (b"Host: localhost\r\nOrigin: http://[", 400),
        (b"Host: ]", 400),
        (b"Host: \xff\xfe", 403),
        (b"Host: localhost\r\nX-Elevon-Token: \xff", 403),
    ],
)
@pytest.mark.parametrize("path", ["state", "stream", ""])
def test_malformed_heads_are_refused_without_an_error(live, head, status, path):
    if path == "" and b"Token" in head:
        status = 200  # the page itself holds nothing
    if path == "stream":
        head += UPGRADE
    assert _raw(live, f"GET /{path} HTTP/1.1".encode(), head) == status


@pytest.mark.parametrize("path", ["page/{}.js", "files/{}", "page/%00.js", "page/..%2f{}.js", "{}"])
def test_paths_that_lead_nowhere(live, path):
    head = f"Host: localhost\r\nX-Elevon-Token: {live.token}".encode()
    line = f"GET /{path.format('a' * 5000)} HTTP/1.1".encode()
    assert _raw(live, line, head) == 404


def _raw(live, line, head):
    place = ("127.0.0.1", int(live.address.rstrip("/").rpartition(":")[2]))
    with socket.create_connection(place, timeout=30) as peer:
        peer.sendall(line + b"\r\n" + head + b"\r\n\r\n")
        return int(peer.recv(4096).split()[1])


def test_viewers_that_vanish_leave_no_line(tmp_path):
    """Connections that are reset while a picture is on its way: stderr stays empty."""
    with bench("--fidelity", "low", folder=tmp_path) as server:
        sockets = [_socket(server).__enter__() for _ in range(12)]  # none is closed in order
        for viewer in sockets:
            _viewer(viewer)
            linger = struct.pack("ii", 1, 0)  # closing resets the connection
            viewer.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
            os.close(viewer.socket.detach())
        server.until(lambda state: state["control"]["viewers"] == 0)
        assert server.request("state")[0] == 200
        server.process.send_signal(signal.SIGINT)
        assert "Traceback" not in (text := server.process.stderr.read())
        assert "Exception" not in text


def test_an_error_of_ours_is_a_line_and_no_traceback(caplog):
    """A planted error in a handler: status 500, one line on the log."""

    async def broken(_):
        raise KeyError("planted")

    async def receive():
        return {"type": "http.request", "body": b""}

    async def send(message):
        sent.append(message)

    sent = []
    scope = {"type": "http", "method": "GET", "path": "/broken", "headers": [], "query_string": b""}
    asyncio.run(Quiet([Route("/broken", broken)])(scope, receive, send))
    assert sent[0]["status"] == 500
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == [
        "live: http '/broken': KeyError: 'planted'"
    ]
    assert all(record.exc_info is None for record in caplog.records)


@pytest.mark.parametrize("act", ["record", "save", "repeat", "restart"])
def test_no_step_of_a_script_writes_files(live, act):
    status, answer = live.act(repeat=[{"time": 0.0, act: True}])
    assert (status, answer["error"][:15]) == (400, "repeat: step 0:")


def test_a_port_that_is_taken_is_wrong_input(live, capsys):
    port = live.address.rstrip("/").rpartition(":")[2]
    assert main(["live", "--port", port, "--fidelity", "low", "--no-browser"]) == 2
    streams = capsys.readouterr()
    assert port in streams.err
    assert streams.out == ""


def test_state_has_time_factor_values_and_health(live):
    state = live.state()
    assert state["time"] >= 0.0
    assert isinstance(state["factor"], float)
    assert {"output_position", "motor_speed"} <= state["values"].keys()
    assert {"status", "faults"} <= state["health"].keys()


def test_a_command_moves_the_output(live):
    status, answer = live.act(command=SINE)
    assert status == 200
    begin = answer["time"]
    live.until(lambda state: state["time"] > begin + 1.0 and state["values"]["motor_speed"] != 0.0)


def test_a_fault_and_a_setting_are_taken(live):
    status, _ = live.act(fault={"backlash@transmission": "0.5 deg"}, set={"output": "5 N m"})
    assert status == 200
    state = live.state()
    assert state["injected"] == {"backlash@transmission": "0.5 deg"}
    assert state["inputs"]["output"] == "5 N m"
    live.act(fault={"backlash@transmission": 0}, set={"output": 0})
    assert live.state()["injected"] == {}


@pytest.mark.parametrize(
    ("message", "part"),
    [
        ({"comand": {}}, "command"),
        ({"command": {"terms": [{"kind": "sin"}]}}, "sine"),
        ({"command": {"terms": [{"kind": "constant", "value": "2000 deg"}]}}, "bench takes"),
        ({"command": {"mode": "gear"}}, "gear"),
        ({"fault": {"backlsh@transmission": 1}}, "backlash"),
        ({"fault": {"backlash@transmission": "5 rad"}}, "outside"),
        ({"fault": {"backlash@transmission": True}}, "severity"),
        ({"set": {"supply": "10 kV"}}, "bench takes"),
        ({"set": {"supply": "10 m"}}, "V"),
        ({"set": {"friction.statc": 1}}, "friction.static"),
        ({"set": []}, "table"),
        ({"record": 7}, "record"),
        ({"factor": 1e6}, "100"),
        ({"panel": "mve"}, "move"),
    ],
)
def test_what_cannot_be_is_refused_by_name(live, message, part):
    status, answer = live.act(**message)
    assert status == 400
    assert part in answer["error"]


@pytest.mark.parametrize(
    "body", [b"", b"{", b"[]", b"\xff\xfe", b'{"factor": NaN}', b'{"factor": 1e999}', b"[" * 9000]
)
def test_what_is_no_message_is_refused(live, body):
    assert live.request("act", body)[0] == 400


def test_a_long_message_is_refused(live):
    assert live.request("act", b'{"set": "' + b"x" * 70_000 + b'"}')[0] == 400


def test_interlocks_of_the_watch_table(live):
    live.act(panel="reset")
    status, answer = live.act(panel="move")
    assert (status, answer["error"]) == (400, "panel: move: enable first")
    live.act(panel="enable", block=SINE)
    assert "home first" in live.act(panel="move")[1]["error"]
    live.act(panel="home")
    live.until(lambda state: state["panel"]["homed"])
    assert live.act(panel="move")[0] == 200
    assert live.state()["panel"]["moving"]
    live.act(panel="stop")
    assert not live.state()["panel"]["moving"]


def test_another_origin_or_host_is_refused(live):
    for headers in ({"Origin": "http://evil.example"}, {"Host": "evil.example"}):
        assert live.request("state", headers=headers)[0] == 403
        assert live.request("act", {"pause": True}, headers)[0] == 403
    with pytest.raises(InvalidStatus):
        _socket(live, origin="http://evil.example")


def test_the_page_may_run_no_foreign_script(live):
    status, _, headers = live.request("")
    assert status == 200
    assert "script-src 'self'" in headers["content-security-policy"]
    assert live.request("page/../bench.py")[0] == 404
    assert live.request("page/uplot.js")[0] == 200


def test_a_recording_is_what_a_drive_writes(live):
    from elevon.logs.read import read_log

    live.act(command=SINE)
    assert live.act(record=True)[0] == 200
    assert live.act(record=True)[0] == 400
    begin = live.state()["time"]
    live.until(lambda state: state["time"] > begin + 3.0)
    _, answer = live.act(record=False)
    log = read_log(answer["files"][0])
    assert log.has("output_position", "motor_speed", "speed_ref", "torque_current")
    assert log.note.command is not None or log.note.waveform == "sine"
    name = answer["files"][0].rpartition("/")[2]
    assert live.request(f"files/{name}")[0] == 200
    assert live.request("files/other.csv")[0] == 404
    assert live.act(record=False)[0] == 400


def test_what_was_done_is_a_scenario(live, tmp_path):
    from elevon import Scenario

    live.act(restart=True)
    live.act(command=SINE, fault={"friction@transmission": 0.5}, set={"output": "4 N m"})
    _, answer = live.act(save=True)
    path = tmp_path / "done.toml"
    path.write_text(answer["scenario"])
    scenario = Scenario.load(path)
    assert scenario.command.terms[0].kind == "sine"
    assert scenario.fault[0].kind == "friction"
    assert scenario.loads.output.terms[-1].arguments["final"] == "4.0 N m"
    assert answer["steps"][-1]["fault"] == {"friction@transmission": 0.5}
    live.act(restart=True, fault={"friction@transmission": 0})


def _viewer(socket):
    return json.loads(socket.recv())["viewer"]


def test_one_viewer_at_a_time_has_control(live):
    with _socket(live) as first, _socket(live) as second:
        one, two = _viewer(first), _viewer(second)
        assert live.act({"X-Viewer": one}, pause=False)[1]["control"]
        assert live.act({"X-Viewer": two}, pause=False)[0] == 409
        assert live.act(pause=False)[0] == 409
        live.act({"X-Viewer": one}, release=True)
        assert live.act(pause=False)[0] == 200
        assert live.act({"X-Viewer": two}, pause=False)[0] == 200
    live.until(lambda state: state["control"] == {"held": False, "viewers": 0})


def test_snapshots_hold_the_signals_that_were_chosen(live):
    with _socket(live) as one:
        _viewer(one)
        one.send(json.dumps({"watch": ["motor_speed", "none", "command"], "choice": 7}))
        while True:
            data = one.recv(timeout=30)
            if isinstance(data, bytes):
                time, _, wanted, choice, rows, columns = struct.unpack_from("<ddfIII", data)
                if choice == 7 and rows:
                    break
        assert (columns, wanted) == (2, 10.0)
        assert len(data) == 32 + rows * (8 + 4 * columns)
        assert time > 0.0


def test_malformed_messages_leave_the_server_up(live):
    import random

    rng = random.Random(30)
    with _socket(live) as one:
        _viewer(one)
        for _ in range(1000):
            text = "".join(rng.choice('{}[]":,0e-."watchcommandfault ') for _ in range(40))
            one.send(rng.choice([text, text.encode(), '{"watch": 3}', '{"factor": "x"}']))
        errors = 0
        while errors < 1000:
            data = one.recv(timeout=30)
            errors += isinstance(data, str) and "error" in data
    assert live.state()["time"] > 0.0


def test_a_viewer_that_hangs_slows_nobody(live):
    with _socket(live, max_queue=1, close_timeout=0.1) as hanging, _socket(live) as other:
        _viewer(hanging)  # and reads no more
        _viewer(other)
        begin = live.state()["time"]
        for _ in range(20):
            other.recv(timeout=30)
        assert live.state()["time"] > begin


@pytest.mark.long
def test_full_buffers_of_a_viewer_cost_nothing(live):
    """A viewer with a small buffer that reads nothing for 40 s: its snapshots are dropped."""
    narrow = socket.create_connection(("127.0.0.1", int(live.address.rstrip("/").split(":")[-1])))
    narrow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    watch = {"watch": [*live.state()["values"]][:12], "choice": 1}
    hanging = _socket(live, sock=narrow, max_queue=1, close_timeout=0.1)
    with hanging, _socket(live) as other:
        for one in (hanging, other):
            _viewer(one)
            one.send(json.dumps(watch))
        before, begin, count, size = live.memory(), time.monotonic(), 0, 0
        while time.monotonic() < begin + 40.0:
            packed = other.recv(timeout=5)
            count, size = count + isinstance(packed, bytes), size + len(packed)
    assert count > 20 * 40
    assert size > 4e6  # more than the buffers of a connection hold
    assert live.memory() - before < 2e6


@needs_browser
def test_run_moves_the_picture(live):
    with browser() as run:
        page, complaints = opened(run, live)
        before = page.evaluate(PICTURE)
        press(page, "#run")
        until(page, "elevonPage.state.panel.moving && elevonPage.store.latest.motor_speed")
        until(page, "elevonPage.latency !== null")  # what the act did has been drawn
        assert page.evaluate(PICTURE) != before
        assert live.state()["control"]["held"]
        assert complaints == []
    live.until(lambda state: state["control"] == {"held": False, "viewers": 0})
