"""An actuator from few numbers: rules derive the rest, follow a change, refuse what cannot be."""

import math

import pytest

from elevon import Actuator, simulate
from elevon.errors import InputError, RangeError, UnitError, UnknownNameError
from elevon.parameters import records
from elevon.parameters.design import quantities
from elevon.parameters.design.rule import TERMS, evaluate, rules

MINE = {"supply": "28 V", "power": "50 W", "lead": "2 mm", "gear": 4, "encoder": 1024}
JOINT = {"supply": "48 V", "torque": "49 N m", "speed": "25 rpm", "gear": 100}


def actuator(folder, numbers, base="neutral-linear", more=""):
    lines = [f"{key} = {value!r}" for key, value in numbers.items()]
    path = folder / "mine.toml"
    path.write_text(f'base = "{base}"\n{more}[design]\n' + "\n".join(lines) + "\n")
    return Actuator.load(path)


def test_five_numbers_are_a_whole_actuator(tmp_path):
    mine = actuator(tmp_path, MINE)
    value = mine.parameters.value
    assert [mine.findings(fidelity) for fidelity in ("high", "low")] == [[], []]
    # 50 W at the ASSUMED 3000 rpm through 4 : 1 and 2 mm: 25 mm/s; 0.9 * 0.8 * 50 W over it
    assert mine.design["motor_speed"].confidence == "assumed"
    assert mine.design["speed"].value == pytest.approx(0.025)
    assert mine.design["thrust"].value == pytest.approx(1440.0)
    assert value("motor.emf_constant") == pytest.approx(
        0.85 * 0.8 * 28 / math.sqrt(3) / (100 * math.pi)
    )
    assert value("control.torque_constant") == pytest.approx(1.5 * value("motor.emf_constant"))
    # counts are per turn of the motor: of four turns per 2 mm
    counts = [value(f"sensor.encoder.{name}") for name in ("pulses", "edges", "interpolation")]
    assert math.prod(counts) == pytest.approx(1024 * 4 / 0.002)
    assert mine.parameters["motor.emf_constant"].source == "derived: constant-from-supply"


def test_what_changes_is_followed(tmp_path):
    before = actuator(tmp_path, MINE).parameters
    after = actuator(tmp_path, {**MINE, "supply": "24 V"}).parameters
    for path in ("motor.emf_constant", "control.torque_constant", "pwm.emf_constant"):
        assert after.value(path) == pytest.approx(24 / 28 * before.value(path))
    heavy = actuator(tmp_path, MINE, more='motor.inertia = "0.4 kg cm2"\n').parameters
    ratio = 4e-5 / before.value("motor.inertia")
    # the bandwidth that the torque allows falls as the inertia grows, so the gain stays
    assert heavy.value("control.speed_gain") == pytest.approx(before.value("control.speed_gain"))
    assert heavy.value("control.position_gain") == pytest.approx(
        before.value("control.position_gain") / ratio
    )


def test_a_file_above_moves_no_rule(tmp_path):
    below = actuator(tmp_path, MINE).parameters
    top = tmp_path / "fitted.toml"
    top.write_text('base = "mine.toml"\nmotor.inertia = "0.4 kg cm2"\n')
    fitted = Actuator.load(top).parameters
    assert fitted.value("motor.inertia") == 4e-5
    changed = [path for path in below if fitted[path].value != below[path].value]
    assert changed == ["motor.inertia"]
    top.write_text('base = "mine.toml"\n[design]\nsupply = "24 V"\n')
    assert Actuator.load(top).parameters.value("inverter.supply_voltage") == 24.0


@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize(("numbers", "base"), [(MINE, "neutral-linear"), (JOINT, "neutral-rotary")])
def test_it_moves_within_its_current_and_holds_its_rating(tmp_path, numbers, base, fidelity):
    mine = actuator(tmp_path, numbers, base)
    design = {name: item.value for name, item in mine.design.items()}
    record = "output_position,motor_speed,current_q@1 kHz"
    target = 0.2 * design["stroke"]
    step = {"duration": target / design["speed"] + 0.5 / design["bandwidth"] + 0.3,
            "command": {"terms": [{"kind": "constant", "value": target}]}}  # fmt: skip
    run = simulate(mine, step, fidelity=fidelity, record=record)
    assert abs(run["output_position"].values[-1] - target) < design["backlash"]
    assert run["output_position"].values.max() < 1.01 * target
    assert abs(run["current_q"].values).max() < 1.001 * design["current"]
    load = design["thrust" if "lead" in design else "torque"]
    pull = {"duration": 0.4 * design["stroke"] / design["speed"],
            "command": {"terms": [{"kind": "ramp", "slope": design["speed"]}]},
            "load": {"output": {"terms": [{"kind": "constant", "value": load}]}}}  # fmt: skip
    run = simulate(mine, pull, fidelity=fidelity, record=record)
    half = len(run["motor_speed"].values) // 2
    assert run["motor_speed"].values[half:].mean() == pytest.approx(design["motor_speed"], rel=0.01)
    # a tenth of the torque is left; the warm-up and the ripple take little of it
    assert run["current_q"].values[half:].mean() == pytest.approx(
        0.91 * design["current"], rel=0.03
    )


def test_constants_of_a_data_sheet_replace_the_rules(tmp_path):
    sheet = '[design.motor]\ntorque_constant = "33.5 mN m/A"\nresistance = "0.6 ohm"\n'
    sheet += 'inductance = "0.3 mH"\ninertia = "135 g cm2"\npole_pairs = 8\ncurrent = "3.2 A"\n'
    numbers = {"supply": "28 V", "lead": "2 mm"}
    path = tmp_path / "mine.toml"
    lines = "\n".join(f'{key} = "{value}"' for key, value in numbers.items())
    path.write_text(f'base = "neutral-linear"\n[design]\n{lines}\n{sheet}')
    mine = Actuator.load(path)
    value = mine.parameters.value
    assert value("motor.emf_constant") == pytest.approx(0.0335 / math.sqrt(3))
    assert value("motor.winding_resistance") == pytest.approx(0.3)
    assert value("motor.inertia") == pytest.approx(1.35e-5)
    assert value("motor.pole_pairs") == 8.0
    # the current's torque is the data sheet's
    torque = value("control.torque_constant") * mine.design["current"].value
    assert torque == pytest.approx(0.0335 * 3.2)
    assert mine.design["motor_speed"].source == "derived: speed-from-supply"


@pytest.mark.parametrize(
    ("numbers", "error", "text"),
    [
        ({"gear": 4, "lead": None}, InputError, "lacks lead"),
        ({"power": None}, InputError, "lacks power (or thrust and speed"),
        ({"supply": 28}, InputError, "28 has no unit; write it like '28 V'"),
        ({"supply": "28 W"}, UnitError, "expected a voltage"),
        ({"power": "-50 W"}, RangeError, "outside (0, inf) W"),
        ({"lead": "0 mm"}, RangeError, "travel per turn"),
        ({"efficiency": 1.2}, RangeError, "(0, 1]"),
        ({"encoder": 10.5}, RangeError, "10 or 11"),
        ({"gear": "1:4"}, InputError, "written like 4"),
        ({"torque": "5 N m"}, UnknownNameError, "number of a design"),
        ({"pwer": "5 W"}, UnknownNameError, "did you mean 'power'"),
        ({"thrust": "1 kN", "speed": "100 mm/s"}, InputError, "are 100 W; power = 50 W"),
        ({"speed": "50 mm/s", "motor_speed": "3000 rpm"}, InputError, "at most 25 mm/s"),
        ({"bandwidth": "200 Hz"}, InputError, "at most 50 Hz"),
        ({"motor": {"current": "3 A"}}, InputError, "needs motor.torque_constant"),
        ({"motor": {"torque_constant": "33 mN m/A", "resistance": "0.6 ohm"}, "speed": "200 mm/s"},
         InputError, "at most 7760 rpm"),
        ({"motor": {"torque_constant": "33 mN m/A", "current": "1 A"}},
         InputError, "continuous current"),
        ({"motor": {"kind": "stepper"}}, InputError, "none of 'brushless', 'servo', 'dc'"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_its_limit(tmp_path, numbers, error, text):
    import tomlkit

    wanted = {key: value for key, value in {**MINE, **numbers}.items() if value is not None}
    path = tmp_path / "mine.toml"
    path.write_text(tomlkit.dumps({"base": "neutral-linear", "design": wanted}))
    with pytest.raises(error) as caught:
        Actuator.load(path)
    assert text in str(caught.value)
    assert "mine.toml" in str(caught.value)


def test_a_neutral_base_alone_is_not_complete(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('base = "neutral-linear"\n')
    with pytest.raises(InputError, match=r"only with \[design\]"):
        Actuator.load(path)
    path.write_text('base = "torino-rotary"\n[design]\nsupply = "28 V"\n')
    with pytest.raises(InputError, match="has no neutral base"):
        Actuator.load(path)


@pytest.mark.parametrize("wiring", ["ballscrew", "rotary"])
def test_formulas_name_what_a_design_or_an_actuator_has(wiring):
    known = {*quantities(wiring), *records(wiring), *TERMS, "current"}
    for name, rows in rules().items():
        for rule in (row for row in rows if row.form in {"", wiring}):
            names = []
            evaluate(rule.value, lambda each, names=names: names.append(each) or 1.0)
            load = (
                {"thrust", "torque"}
                if rule.given and rule.given[-1] in {"thrust", "torque"}
                else set()
            )
            assert {*names} <= known | load, (name, rule.name)


@pytest.mark.parametrize("formula", ["open('x')", "a if b else c", "a[0]", "'text'", "a % b"])
def test_a_formula_holds_arithmetic_alone(formula):
    with pytest.raises(ValueError, match="no place in a formula"):
        evaluate(formula, lambda _: 1.0)
