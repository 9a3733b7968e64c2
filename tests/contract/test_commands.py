"""The same five commands on every actuator: bench run, import, calibrate, validate, compare.

The procedure is made of the actuator file's own scenario, so that no actuator is known here by
name.
"""

import json

import pytest

from elevon import Actuator, Recording
from elevon.cli import main
from elevon.parameters.load import set_names

pytestmark = pytest.mark.filterwarnings("ignore")
SECONDS = 9.0


def run(capsys, *words):
    """Run a command that must succeed; return its JSON object."""
    capsys.readouterr()
    code = main([str(word) for word in words])
    captured = capsys.readouterr()
    assert code == 0, captured.err
    return json.loads(captured.out)


def quoted(value):
    """TOML of nested plain values."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {quoted(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(quoted(item) for item in value) + "]"
    return json.dumps(value)


@pytest.fixture(scope="module", params=set_names())
def bench(request, tmp_path_factory):
    """Name, and the log of the actuator file's own scenario on its stand."""
    name = request.param
    folder = tmp_path_factory.mktemp(name)
    command = quoted(Actuator.load(name).default_scenario["command"])
    (folder / "own.toml").write_text(
        'name = "own"\n[[step]]\nkind = "trace"\nname = "log"\n'
        f'duration = "{SECONDS} s"\ncommand = {command}\n'
    )
    words = ["bench", "run", folder / "own.toml", "--actuator", name, "--fidelity", "low"]
    code = main([str(word) for word in [*words, "--out", folder, "--json"]])
    assert code == 0
    return name, folder / "log.csv"


def test_bench_run_and_import(bench, tmp_path, capsys):
    _, log = bench
    out = tmp_path / "log.parquet"
    report = run(capsys, "import", log, "--out", out, "--json")
    assert report["status"] == "ok"
    assert {"motor_speed", "output_position", "torque_current"} <= Recording.load(out).roles.keys()


def test_validate_on_the_model_that_made_the_log(bench, tmp_path, capsys):
    name, log = bench
    words = ["validate", log, "--actuator", name, "--transient", "2", "--json"]
    page = tmp_path / "page.html"
    report = run(capsys, *words, "--report", page)
    assert all(row["log"] in page.read_text("utf-8") for row in report["signals"])
    errors = {row["signal"]: row["rms_percent_of_range"] for row in report["signals"]}
    speed = errors["motor_speed"]
    assert speed < 2.0
    assert min(value for key, value in errors.items() if "position" in key) < 0.5


@pytest.mark.long
def test_calibrate_determines_something(bench, capsys):
    name, log = bench
    report = run(capsys, "calibrate", log, "--actuator", name, "--json")
    assert report["parameters"]
    for item in report["parameters"].values():
        assert item["low"] <= item["value"] <= item["high"]


@pytest.mark.long
def test_compare_by_default(bench, capsys):
    name, _ = bench
    report = run(capsys, "compare", name, "--loads", "--json")
    assert list(report["loads"]) == ["as given", "opposing", "aiding"]
    for item in report["loads"].values():
        assert item["position_nrmse"] < 0.01
