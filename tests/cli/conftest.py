"""Running the command line inside the tests' process."""

import json
from dataclasses import dataclass

import pytest

from elevon.cli import main


@dataclass
class Result:
    code: int
    out: str
    err: str

    @property
    def json(self):
        return json.loads(self.out)


@pytest.fixture
def elevon_cli(capsys, monkeypatch, tmp_path):
    """Call the command line; a failure has a message on stderr and nothing on stdout."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        if code not in (0, 1):
            assert captured.out == ""
            assert captured.err.strip()
            assert "Traceback" not in captured.err
        return Result(code, captured.out, captured.err)

    return run
