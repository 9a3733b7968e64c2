"""`list` and `show`."""

import json
import re
import xml.etree.ElementTree as ET

import pytest

from elevon import _core
from elevon.cli.registry import commands as entries


def test_actuators(elevon_cli):
    rows = elevon_cli("list", "actuators", "--json").json["actuators"]
    assert "torino-rotary" in [row["name"] for row in rows]
    assert "torino-rotary" in elevon_cli("list", "actuators").out


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_signals(elevon_cli, fidelity):
    rows = elevon_cli("list", "signals", "torino-rotary", "--fidelity", fidelity, "--json").json
    expected = [item["name"] for item in _core.signals("rotary", fidelity)]
    assert [row["name"] for row in rows["signals"]] == expected


def test_parameters(elevon_cli):
    rows = elevon_cli("list", "parameters", "torino-rotary", "--json").json["parameters"]
    assert len(rows) == len(_core.parameters("rotary"))
    turns = next(row for row in rows if row["path"] == "motor.turns_a")
    assert turns["range"] == "(0, 1]"


def test_faults(elevon_cli):
    rows = elevon_cli("list", "faults", "torino-rotary", "--json").json["faults"]
    # A connector opens behind a link of its own only, which this drive has not.
    kinds = {record["kind"] for record in _core.faults("rotary")}
    assert kinds - {row["kind"] for row in rows} == {"connector_open"}
    assert {"kind", "places", "unit", "range", "effect", "source"} <= rows[0].keys()
    text = elevon_cli("list", "faults").out
    assert "motor.phase_a" in text


def test_waveforms(elevon_cli):
    rows = elevon_cli("list", "waveforms", "--json").json["waveforms"]
    assert {"sine", "chirp", "table"} <= {row["kind"] for row in rows}
    assert "amplitude*" in elevon_cli("list", "waveforms").out


def test_show_gives_every_number_with_its_source(elevon_cli):
    listing = elevon_cli("show", "torino-rotary", "--json").json
    assert len(listing["parameters"]) == len(_core.parameters("rotary"))
    assert all(row["source"] for row in listing["parameters"])
    text = elevon_cli("show", "torino-rotary").out
    assert "7.7 kg cm2" in text
    assert "T1 Table 1" in text
    assert "Power electronics" in text


def test_show_follows_set(elevon_cli):
    listing = elevon_cli("show", "torino-rotary", "--set", "motor.inertia=9 kg cm2", "--json").json
    row = next(row for row in listing["parameters"] if row["path"] == "motor.inertia")
    assert row["value"] == 9e-4
    assert row["confidence"] == "override"


def test_diagram_and_schema_are_files(elevon_cli, tmp_path):
    svg, schema = tmp_path / "d.svg", tmp_path / "s.json"
    arguments = ("show", "torino-rotary", "--svg", svg, "--schema", schema)
    assert elevon_cli(*arguments).code == 0
    root = ET.fromstring(svg.read_text())
    assert root.tag.endswith("svg")
    assert "motor" in json.loads(schema.read_text())["properties"]
    again = elevon_cli(*arguments)
    assert again.code == 2
    assert "--force" in again.err
    assert elevon_cli(*arguments, "--force").code == 0


def test_every_command_has_help(elevon_cli):
    overview = elevon_cli("--help").out
    for name in entries():
        assert name in overview
        result = elevon_cli(name, "--help")
        assert result.code == 0
        assert "Usage" in result.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("simulte",), "Did you mean simulate"),
        (("list", "signals", "torino-rotry"), "did you mean 'torino-rotary'"),
        (("list", "signals", "torino-rotary", "--fidelity", "hihg"), "did you mean 'high'"),
        (("show", "torino-rotary", "--svgg", "x"), "--svg"),
        (("show",), "Missing argument"),
        (("show", "absent.toml"), "no such actuator file"),
    ],
)
def test_bad_usage(elevon_cli, arguments, message):
    result = elevon_cli(*arguments)
    assert result.code == 2
    assert message in result.err


def test_version(elevon_cli):
    """The version, and in a checkout its commit."""
    version, _, commit = elevon_cli("--version").out.strip().partition(" ")
    assert version == _core.version()
    assert re.fullmatch(r"\([0-9a-f]{12}\)", commit)


def test_the_faults_of_an_actuator_are_its_own(elevon_cli):
    """Circuits end at the nut's four; namesakes are distinguished."""
    rows = elevon_cli("list", "faults", "nasa-ballscrew", "--json").json["faults"]
    kinds = {row["kind"]: row for row in rows}
    assert kinds["return_jam"]["range"] == "[0, 4]"
    for first, second in (
        ("jam", "return_jam"),
        ("lubrication", "lubrication_loss"),
        ("backlash", "adapter_gap"),
    ):
        assert f"`{second}`" in kinds[first]["effect"]
        assert f"`{first}`" in kinds[second]["effect"]


def test_places_that_nothing_reads_are_not_listed(elevon_cli):
    """Every shipped actuator lists a part of its wiring's catalogue."""
    every = elevon_cli("list", "faults", "--json").json["faults"]
    for name in ("torino-rotary", "nasa-ballscrew"):
        faults = elevon_cli("list", "faults", name, "--json").json["faults"]
        whole = {
            (row["kind"], place)
            for row in every
            if row["wiring"] == faults[0]["wiring"]
            for place in row["places"]
        }
        listed = {(row["kind"], place) for row in faults for place in row["places"]}
        assert listed <= whole
        assert ("short", "motor.phase_a") in listed


@pytest.mark.parametrize("what", ["faults", "parameters"])
def test_what_a_fidelity_carries_and_declines_are_the_whole(elevon_cli, what):
    """Split by --fidelity and --not-modelled, nothing is lost; every refusal has its reason."""
    whole = elevon_cli("list", what, "torino-rotary", "--json").json[what]
    words = ("list", what, "torino-rotary", "--fidelity", "low")
    carried = elevon_cli(*words, "--json").json[what]
    not_modelled = elevon_cli(*words, "--not-modelled", "--json").json[what]
    assert carried
    assert not_modelled
    assert all("low" in row["fidelities"] for row in carried)
    assert all(row["not_modelled"]["low"] for row in not_modelled)
    assert len(carried) + len(not_modelled) == len(whole)
    reason = not_modelled[0]["not_modelled"]["low"]
    assert reason in " ".join(elevon_cli(*words, "--not-modelled").out.split())


def test_faults_say_under_which_drives_they_act(elevon_cli, monkeypatch):
    """At each fidelity that carries them; the places at rest with their reasons."""
    rows = elevon_cli("list", "faults", "torino-rotary", "--json").json["faults"]
    kinds = {row["kind"]: row for row in rows}
    assert set(kinds["short"]["drives"]) == {"high", "low"}
    assert {"hysteresis", "pwm"} <= set(kinds["short"]["drives"]["low"])
    idle = kinds["open_switch"]["resting"]
    assert {row["fidelity"] for row in idle} == {"low"}
    assert all(row["reason"] == kinds["open_switch"]["not_modelled"]["low"] for row in idle)
    monkeypatch.setenv("COLUMNS", "1000")
    assert "high (hysteresis pwm" in elevon_cli("list", "faults", "torino-rotary").out


def test_show_says_where_parameters_act(elevon_cli):
    """With which choice, at which fidelity and why not at the other."""
    text = elevon_cli("show", "torino-rotary").out
    assert "drive.kind = pwm" in text
    words = ("show", "torino-rotary", "--fidelity", "low", "--not-modelled")
    rows = elevon_cli(*words, "--json").json["parameters"]
    assert "solver.step" in [row["path"] for row in rows]
    assert all(row["not_modelled"]["low"] in elevon_cli(*words).out for row in rows[:1])
    assert elevon_cli("show", "torino-rotary", "--fidelity", "lo").code == 2
