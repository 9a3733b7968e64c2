"""A live bench in a process of its own, as a person starts it."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from pathlib import Path

SINE = {"terms": [{"kind": "sine", "amplitude": "6 deg", "bias": "10 deg", "frequency": "0.5 Hz"}]}


class Bench:
    """The server's address, and requests to it."""

    def __init__(self, process, line):
        self.process, self.line = process, line
        self.link = line.split()[-1]
        self.address, _, self.token = self.link.partition("?token=")

    def request(self, path, data=None, headers=None, *, token=True):
        body = (
            None if data is None else data if isinstance(data, bytes) else json.dumps(data).encode()
        )
        known = {"X-Elevon-Token": self.token} if token else {}
        made = urllib.request.Request(self.address + path, body, known | (headers or {}))
        try:
            with urllib.request.urlopen(made, timeout=30) as answer:
                return answer.status, answer.read(), answer.headers
        except urllib.error.HTTPError as error:
            return error.code, error.read(), error.headers

    def state(self):
        status, body, _ = self.request("state")
        assert status == 200
        return json.loads(body)

    def memory(self):
        """Resident bytes of the server's process (Linux)."""
        text = Path(f"/proc/{self.process.pid}/statm").read_text("ascii")
        return int(text.split()[1]) * resource.getpagesize()

    def act(self, headers=None, **message):
        status, body, _ = self.request("act", message, headers)
        return status, json.loads(body)

    def until(self, condition, seconds=600.0):
        """Wait for a state; the clock only ends a wait that has failed."""
        end = time.monotonic() + seconds
        while not condition(state := self.state()):
            assert time.monotonic() < end, state
            time.sleep(0.1)
        return state


@contextmanager
def bench(*words, folder):
    command = [sys.executable, "-m", "elevon", "live", *words, "--no-browser", "--out", str(folder)]
    if "--port" not in words:
        command += ["--port", "0"]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=dict(os.environ),
    )
    try:
        yield Bench(process, process.stdout.readline())
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(30)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        process.stdout.close()
        process.stderr.close()
