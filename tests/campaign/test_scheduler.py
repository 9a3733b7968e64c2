"""What answers at a scheduler's address, or does not: a message in ten seconds, no traceback."""

import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from threading import Thread

import pytest

from elevon.campaign.cluster import LIMIT, check_scheduler
from elevon.errors import InputError


@pytest.fixture
def listener():
    """Listen on a port and send every caller some bytes (None: nothing, and keep the line)."""
    sockets = []

    def start(data):
        server = socket.create_server(("127.0.0.1", 0))
        sockets.append(server)

        def serve():
            try:
                peer, _ = server.accept()
            except OSError:
                return
            sockets.append(peer)
            if data is not None:
                with suppress(OSError):  # the caller may have hung up already
                    peer.sendall(data)
                    peer.shutdown(socket.SHUT_WR)

        Thread(target=serve, daemon=True).start()
        return f"tcp://127.0.0.1:{server.getsockname()[1]}"

    yield start
    for item in sockets:
        item.close()


@pytest.mark.parametrize(
    "data", [b"SSH-2.0-OpenSSH_9.6\r\n", b"HTTP/1.1 400 Bad Request\r\n", b"", b"\0" * 8, b"abc"]
)
def test_what_is_no_scheduler_is_told_by_its_first_bytes(listener, data):
    with pytest.raises(InputError, match="no Dask scheduler"):
        check_scheduler(listener(data))


def test_a_silent_listener_is_left_within_the_limit(listener):
    begin = time.monotonic()
    with pytest.raises(InputError, match="no scheduler answers within"):
        check_scheduler(listener(None))
    assert time.monotonic() - begin < LIMIT


@pytest.mark.parametrize(
    ("address", "text"),
    [
        ("", "is no address"),
        (" ", "is no address"),
        ("localhost", "is no address; give tcp://HOST:PORT"),
        ("tcp://localhost:0", "is no address"),
        ("tcp://localhost:70000", "is no address"),
        ("http://localhost:8786", "is no address"),
        ("tcp://127.0.0.1:1", "no scheduler answers"),
        ("tcp://no-such-host.invalid:8786", "no scheduler answers"),
        ("tcp://" + "a" * 300 + ":1", "no scheduler answers"),
    ],
)
def test_addresses_that_lead_nowhere(plan, cli, tmp_path, address, text):
    begin = time.monotonic()
    words = ("campaign", "run", plan(), "--out", tmp_path / "out", "--scheduler", address)
    code, report, err = cli(*words)
    assert (code, report) == (2, None)
    assert text in err
    assert "Traceback" not in err
    assert time.monotonic() - begin < LIMIT + 5.0


@pytest.mark.long
@pytest.mark.parametrize("fault", [signal.SIGKILL, signal.SIGSTOP])
def test_no_workers_are_reported_and_a_lost_scheduler_ends_the_wait(plan, tmp_path, fault):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    words = ["-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port)]
    scheduler = subprocess.Popen([sys.executable, *words, "--no-dashboard"],
                                 stderr=subprocess.DEVNULL)  # fmt: skip
    address, run = f"tcp://127.0.0.1:{port}", None
    try:
        _answering(address)
        command = ["campaign", "run", plan(), "--out", tmp_path / "out", "--scheduler", address]
        with (tmp_path / "stderr").open("w") as stream:
            run = subprocess.Popen([sys.executable, "-m", "elevon", *map(str, command)],
                                   stderr=stream, stdout=subprocess.DEVNULL)  # fmt: skip
        _until(lambda: "waiting for workers (0)" in (tmp_path / "stderr").read_text(), 60.0)
        scheduler.send_signal(fault)
        _until(lambda: "no longer answers" in (tmp_path / "stderr").read_text(), LIMIT)
        assert run.wait(60.0) in {1, 2}
        text = (tmp_path / "stderr").read_text()
        assert "Traceback" not in text
    finally:
        for process in filter(None, (scheduler, run)):
            process.kill()
            process.wait()


@pytest.mark.long
def test_a_frozen_worker_is_named_and_its_blocks_are_given_to_others(plan, cli, tmp_path):
    """Two workers, one halted as soon as it writes: the other does its blocks, exit 0."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    address, out, err = f"tcp://127.0.0.1:{port}", tmp_path / "out", tmp_path / "stderr"
    scheduler = ["dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    worker = ["dask_worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard"]
    started = []

    def start(words, stream=subprocess.DEVNULL):
        started.append(subprocess.Popen([sys.executable, "-m", *words], stderr=stream,
                                        stdout=subprocess.DEVNULL))  # fmt: skip
        return started[-1]

    try:
        start([f"distributed.cli.{scheduler[0]}", *scheduler[1:]])
        _answering(address)
        workers = [start([f"distributed.cli.{worker[0]}", *worker[1:]]) for _ in range(2)]
        path = plan(48, head="runs_per_file = 1")
        text = path.read_text().replace('"10 ms"', '"2 s"').replace('"low"', '"high"')
        path.write_text(text)
        words = ["campaign", "run", path, "--out", out, "--scheduler", address]
        with err.open("w") as stream:
            run = start(["elevon", *map(str, words), "--silent-after", "2 s"], stream)
            _until(lambda: len(list(out.glob("ends/*.parquet"))) > 2, 120.0)
            workers[0].send_signal(signal.SIGSTOP)
            assert run.wait(240.0) == 0, err.read_text()
        assert "has given no sign for" in err.read_text()
        assert "are given to others" in err.read_text()
        assert cli("dataset", "verify", out)[0] == 0
        assert cli("campaign", "status", out)[1]["counts"] == {"ok": 48}
    finally:
        for process in started:
            process.kill()
            process.wait()


def _answering(address):
    def there():
        try:
            check_scheduler(address)
        except InputError:
            return False
        return True

    _until(there, 60.0)


def _until(condition, limit):
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.2)
