"""One bench for all tests of this folder, run once."""

import pytest

from elevon import Actuator
from elevon.calibrate import calibrate, read_logs
from tests.calibrate.bench import make_truth, write_logs


@pytest.fixture(scope="session")
def truth():
    return make_truth()


@pytest.fixture(scope="session")
def log_paths(truth, tmp_path_factory):
    return write_logs(truth, tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="session")
def logs(log_paths):
    return read_logs(log_paths)


@pytest.fixture(scope="session")
def before():
    """The set, with the drive a real bench has; that the drive is found is a test of its own."""
    return Actuator.load("torino-rotary").with_values({"drive.kind": "pwm"})


@pytest.fixture(scope="session")
def result(logs, before):
    return calibrate(logs, before, model_runs=False)
