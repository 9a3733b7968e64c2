"""What is set where it cannot act is said on stderr, or refused with --strict."""

import json

import pytest

SIMULATE = ("simulate", "torino-rotary", "--duration", "0.01")
IDLE = {
    "the fidelity": (("--fidelity", "low", "--set", "solver.step=2 us"), "solver.step = 2 us"),
    "the drive": (("--set", "pwm.frequency=5 kHz"), "pwm.frequency = 5 kHz"),
    "an attribute": (
        ("--fault", "short@motor.phase_a=0.1,contact_resistance=1"),
        "contact_resistance",
    ),
}


@pytest.mark.parametrize("case", IDLE)
def test_it_is_named_on_stderr_and_stdout_stays_json(elevon_cli, case):
    options, name = IDLE[case]
    result = elevon_cli(*SIMULATE, *options, "--json")
    assert result.code == 0
    assert result.json["status"] == "ok"
    assert f"elevon: warning: {name}" in result.err.replace("fault short@motor.phase_a: ", "")
    assert "has no effect: " in result.err


@pytest.mark.parametrize("case", IDLE)
def test_strict_refuses_it(elevon_cli, case):
    options, name = IDLE[case]
    result = elevon_cli(*SIMULATE, *options, "--strict")
    assert result.code == 2
    assert name in result.err
    assert "warning" not in result.err


@pytest.mark.parametrize(
    "options",
    [
        ("--fidelity", "low"),  # the set carries a PWM drive and a solver step: nobody asked here
        ("--set", "drive.kind=pwm", "--set", "pwm.frequency=5 kHz"),
        ("--set", "drive.kind=hysteresis"),  # as it is
        ("--fidelity", "low", "--fault", "open_phase@motor.phase_a=0"),
    ],
)
def test_what_acts_or_is_neutral_says_nothing(elevon_cli, options):
    result = elevon_cli(*SIMULATE, *options, "--strict", "--json")
    assert result.code == 0
    assert "warning" not in result.err


def test_what_a_file_states_warns_in_no_run_and_check_lists_it(elevon_cli, tmp_path):
    path = tmp_path / "own.toml"
    entry = 'value = {}\nunit = "{}"\nsource = "ASSUMED: a test"\nconfidence = "assumed"\n'
    path.write_text(
        'base = "torino-rotary"\n[pwm.frequency]\n'
        + entry.format(5.0, "kHz")
        + "[solver.step]\n"
        + entry.format(2.0, "us")
    )
    options = ("--duration", "0.01", "--fidelity", "low", "--strict")
    assert elevon_cli("simulate", path, *options).code == 0
    notes = [row["message"] for row in elevon_cli("check", path, "--json").json["findings"]]
    (note,) = [text for text in notes if "without effect" in text]  # the step acts at one fidelity
    assert "pwm.frequency = 5 kHz" in note
    assert "drive.kind" in note


def test_a_plan_refuses_it_unless_it_allows_it(elevon_cli, tmp_path):
    text = (
        'actuator = "torino-rotary"\nfidelity = "low"\nrecord = "motor_speed@400 Hz"\n'
        '[scenario]\nduration = "0.02 s"\n'
        '[[vary]]\nparameter = "solver.step"\nvalues = ["1 us", "2 us"]\n'
    )
    plan = tmp_path / "plan.toml"
    plan.write_text(text)
    refused = elevon_cli("campaign", "run", plan, "--out", "refused")
    assert refused.code == 2
    assert "run 1: solver.step = 2 us has no effect" in refused.err
    assert not (tmp_path / "refused").exists()
    plan.write_text("allow_not_acting = true\n" + text)
    allowed = elevon_cli("campaign", "run", plan, "--out", "allowed", "--json")
    assert allowed.code == 0
    assert json.loads(allowed.out)["runs"] == 2
    assert allowed.err.count("elevon: warning: solver.step = 2 us has no effect") == 1


def test_lists_say_where_it_acts(elevon_cli, monkeypatch):
    rows = {
        row["path"]: row
        for row in elevon_cli("list", "parameters", "torino-rotary", "--json").json["parameters"]
    }
    assert rows["solver.step"]["fidelities"] == ["high"]
    assert rows["solver.step"]["not_modelled"]["low"] in elevon_cli("show", "torino-rotary").out
    assert rows["pwm.frequency"]["when"] == [
        "drive.kind = pwm",
        "inverter.dead_time away from 0 (fidelity low)",
    ]
    monkeypatch.setenv("COLUMNS", "1000")  # nothing is wrapped
    faults = elevon_cli("list", "faults", "torino-rotary", "--not-modelled")
    not_modelled = [
        row
        for row in elevon_cli("list", "faults", "torino-rotary", "--json").json["faults"]
        if row["not_modelled"]
    ]
    assert not_modelled
    assert all(row["not_modelled"]["low"] in faults.out for row in not_modelled)


def test_a_comparison_names_what_neither_model_carries(elevon_cli, tmp_path):
    scenario = tmp_path / "short.toml"
    scenario.write_text(
        'duration = "1.2 s"\n[[command.terms]]\nkind = "sine"\namplitude = "7 deg"\n'
        'frequency = "2 Hz"\n'
    )
    words = ("compare", "torino-rotary", "--scenario", scenario, "--after", "0.5", "--strict")
    assert elevon_cli(*words, "--set", "solver.step=2 us").code == 0
    refused = elevon_cli(*words, "--set", "pwm.frequency=5 kHz")
    assert refused.code == 2
    assert "pwm.frequency = 5 kHz has no effect" in refused.err
