"""What cannot be calibrated is refused with its reason; what is requested is never guessed."""

import json
from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator
from elevon.calibrate import calibrate, read_logs
from elevon.calibrate.door import _refused
from elevon.calibrate.dynamic import SensitivityTable, choose
from elevon.calibrate.model_runs import SpeedRuns, candidates
from elevon.calibrate.outcome import Calibration
from elevon.cli.runner import run
from elevon.errors import InputError, Interrupted, UnknownNameError
from elevon.logs.formats.drive import write_drive_csv


def standing(folder, **changes):
    """Write a log of a bench that does not move, or moves as `changes` say."""
    time = np.arange(0.0, 20.0, 0.0025)
    rng = np.random.default_rng(1)
    signals = {
        "time": time,
        "encoder_position": np.zeros_like(time),
        "resolver_position": np.zeros_like(time),
        "speed_ref": np.zeros_like(time),
        "motor_speed": rng.normal(0, 0.05, len(time)),
        "current_ref": np.zeros_like(time),
        "current_q_meas": rng.normal(0, 0.03, len(time)),
    } | changes
    folder.mkdir(parents=True, exist_ok=True)
    signals = {name: v for name, v in signals.items() if v is not None}
    return write_drive_csv(folder / "still.csv", signals)


def one_way(folder):
    """Write a log of a bench that turns in one direction only."""
    time = np.arange(0.0, 20.0, 0.0025)
    speed = 10.0 + 0.5 * np.sin(time)
    motor = np.cumsum(speed) * 0.0025
    noise = np.random.default_rng(2).normal(0, 0.02, len(time))
    return standing(
        folder, resolver_position=motor, encoder_position=motor / 124, speed_ref=speed + 0.3,
        motor_speed=speed, current_ref=0.3 + 0.003 * speed, current_q_meas=0.3 + noise,
    )  # fmt: skip


@pytest.mark.long
def test_a_log_at_rest_determines_nothing(tmp_path, before):
    with pytest.raises(InputError, match=r"determine|motion|excites"):
        calibrate(read_logs([standing(tmp_path)]), before)


def test_backlash_without_a_reversal_is_refused(tmp_path, before):
    logs = read_logs([one_way(tmp_path)])
    with pytest.raises(InputError, match=r"backlash.total.*excites"):
        calibrate(logs, before, free=["backlash.total"])


def test_a_parameter_nothing_excites_is_refused(logs, before):
    with pytest.raises(InputError, match=r"--free load.spring_zero.*excites|--free"):
        calibrate(logs[:1], before, free=["load.spring_zero"], hold_out=False)


def test_paths_are_checked(logs, before):
    with pytest.raises(UnknownNameError, match=r"friction.dynamic"):
        calibrate(logs, before, free=["friction.dynamc"])
    with pytest.raises(InputError, match="choice"):
        calibrate(logs, before, free=["drive.kind"])
    with pytest.raises(InputError, match="at least one"):
        calibrate([], before)
    with pytest.raises(UnknownNameError, match="high"):
        calibrate(logs, before, fidelity="hihg")


def test_another_wiring_is_refused(logs):
    with pytest.raises(InputError, match="rotary"):
        calibrate(logs, Actuator.load("nasa-ballscrew"))


def test_missing_columns_are_named(tmp_path, logs):
    with pytest.raises(InputError, match="no channel has the role motor_speed"):
        read_logs([standing(tmp_path / "a", motor_speed=None)])
    with pytest.raises(InputError, match="no torque current"):
        read_logs([standing(tmp_path / "b", current_ref=None, current_q_meas=None)])
    assert logs[0].has("torque_current")


def test_optional_columns_may_lack(tmp_path, truth, before):
    from tests.calibrate.bench import write_logs

    (path,) = write_logs(truth, tmp_path, names=["noload"])
    header, *rows = path.read_text().splitlines()
    gone = [k for k, name in enumerate(header.split(",")) if "r78" in name or "r722" in name]
    lines = [
        ",".join(c for k, c in enumerate(line.split(",")) if k not in gone)
        for line in [header, *rows]
    ]
    path.write_text("\n".join(lines) + "\n")
    data = read_logs([path])
    assert not data[0].has("torque_current")
    result = calibrate(data, before, model_runs=False, hold_out=False)
    ratio = truth.values["friction.dynamic"] / truth.values["derived.torque_constant"]
    scale = 1.5 * before.parameters.value("motor.emf_constant")
    assert result["friction.dynamic"].value == pytest.approx(ratio * scale, rel=0.03)


def test_the_user_can_stop_it(logs, before):
    with pytest.raises(Interrupted):
        calibrate(logs, before, progress=lambda fraction: fraction < 0.2)


def test_the_ranking_drops_what_cannot_be_told_and_names_the_rival(logs, before):
    pwm = before.with_values({"drive.kind": "pwm"})
    free = [
        item
        for item in candidates(pwm, logs[:1], ["motor.inertia", "gear.inertia"])
        if item.kind == "parameter"
    ]
    lanes = SpeedRuns(pwm, logs[:1]).lanes([replace(item, spread=0.5) for item in free])
    point = lanes.point(lanes.first)
    jac = lanes.jacobian([point], central=True)[0]
    blocks = lanes.blocks(point.residual)
    seen = SensitivityTable(tuple(free), 0.2 * jac, point.residual, blocks)
    kept, ranking = choose(seen, [])
    assert len(kept) == 1
    assert len(ranking.dropped) == 1
    with pytest.raises(InputError, match="cannot"):
        choose(seen, [item.path for item in free])


def test_exact_derivatives_agree_with_differences_where_nothing_switches(logs, before):
    pwm = before.with_values({"drive.kind": "pwm"})
    runs = SpeedRuns(pwm, logs[:1])
    path = "friction.viscous"
    value = pwm.parameters.value(path)
    exact = runs.experiments[0].sensitivities(runs.variant(logs[0], {path: value}), [path])[path]
    up, down = (r[0] for r in runs.simulate([{path: 1.01 * value}, {path: 0.99 * value}]))
    for role in ("motor_speed", "torque_current"):
        finite = (up[role] - down[role]) / (0.02 * value)
        assert np.linalg.norm(exact[role] - finite) < 0.1 * np.linalg.norm(finite)


def test_command_line(tmp_path, log_paths, capsys):
    out, page = tmp_path / "set.toml", tmp_path / "page.html"
    arguments = [
        "--actuator",
        "torino-rotary",
        "--free",
        "friction.dynamic,backlash.total",
        "--json",
    ]
    code = run(["calibrate", str(log_paths[0]), *arguments, "--out", str(out),
                "--report", str(page)])  # fmt: skip
    printed = capsys.readouterr()
    assert code == 0
    document = json.loads(printed.out)
    assert document["status"] == "ok"
    assert document["parameters"]["friction.dynamic"]["given"] == ["motor.emf_constant"]
    assert "%" in printed.err
    assert out.is_file()
    assert page.is_file()
    assert run(["validate", str(log_paths[0]), "--actuator", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["status"] == "pass"
    assert run(["calibrate", str(log_paths[0]), *arguments, "--out", str(out)]) == 2
    assert capsys.readouterr().out == ""


def test_command_line_refusals(tmp_path, log_paths, capsys):
    log = str(log_paths[0])
    bad = [
        ["--actuator", "torino-rotry"],
        ["--actuator", "torino-rotary", "--free", "motor.emf_constant"],
        ["--actuator", "torino-rotary", "--free", "auto,backlash.total"],
        ["--actuator", "torino-rotary", "--out", str(tmp_path / "set.txt")],
        ["--actuator", "torino-rotary", "--loadcell", log, "--loadcell", log],
    ]
    for arguments in bad:
        assert run(["calibrate", log, *arguments, "--json"]) == 2, arguments
        printed = capsys.readouterr()
        assert printed.out == ""
        assert printed.err
    empty = tmp_path / "empty.csv"
    empty.write_text("")
    assert run(["validate", str(empty), "--actuator", "torino-rotary"]) == 2


def test_values_that_a_fidelity_refuses_are_said():
    """A fit runs one fidelity; what it gives may be none for the other."""
    before = Actuator.load("torino-rotary")
    after = before.with_values(
        {"friction.dynamic": 2.0 * before.parameters.value("friction.static")}
    )
    result = Calibration(actuator=after, before=before, logs=(), parameters={})
    texts = _refused(result).findings
    assert any("fidelity refuses what was fitted: friction.dynamic" in text for text in texts)
    assert _refused(replace(result, actuator=before)) == replace(result, actuator=before)
