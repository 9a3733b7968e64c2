"""Renaming the columns of a log never changes the log: the same bit for bit, or a question."""

import numpy as np
import pytest

from elevon.errors import QuestionError
from elevon.logs.formats.table import RawTable
from elevon.logs.maps.guess import guess_map
from elevon.logs.read import read_log

RATIO = 124.0
UNITS = {
    "time": "ms", "command": "deg", "output_position": "deg", "motor_position": "rev",
    "speed_ref": "rpm", "motor_speed": "rpm", "current_ref": "A", "torque_current": "A",
}  # fmt: skip
#: Headers of each role in the order of `UNITS`; the unit stands behind them in brackets.
STYLES = {
    "own": tuple(UNITS),
    "english": ("Time", "Position setpoint", "Actual position", "Motor angle", "Speed setpoint",
                "Motor speed", "Current setpoint", "Motor current"),
    "german": ("Zeit", "Sollwinkel", "Istwinkel", "Motorwinkel", "Solldrehzahl", "Istdrehzahl",
               "Sollstrom", "Iststrom"),
    "italian": ("tempo", "angolo comando", "angolo", "angolo motore", "velocità riferimento",
                "velocità", "corrente riferimento", "corrente"),
    "french": ("temps", "consigne angle", "angle", "angle moteur", "consigne vitesse", "vitesse",
               "consigne courant", "courant"),
    "spanish": ("tiempo", "ángulo consigna", "ángulo", "ángulo motor", "velocidad consigna",
                "velocidad", "corriente consigna", "corriente"),
    "short": ("t", "pos_cmd", "pos", "pos_m", "n_ref", "n", "iq_ref", "iq"),
    "moteus": ("time", "command position", "output position", "motor position",
               "command velocity", "velocity", "q-axis cmd", "q-axis"),
    "simulink": ("t", "theta_ref", "theta", "theta_m", "omega_ref", "omega", "i_q_ref", "i_q"),
    "ros": ("timestamp", "reference_position", "actuator_position", "rotor_position",
            "reference_velocity", "rotor_velocity", "desired_current", "measured_current"),
    "plc": ("TIME", "AXIS.CMD_POS", "AXIS.ACT_POS", "AXIS.MOTOR_POS", "AXIS.CMD_VEL",
            "AXIS.ACT_VEL", "AXIS.CMD_CURR", "AXIS.ACT_CURR"),
    "swiss": ("Zeit", "Lage Soll", "Lage Ist", "Lage Motor", "Drehzahl Soll", "Drehzahl Ist",
              "Strom Soll", "Strom Ist"),
    "upper": tuple(name.upper() for name in UNITS),
    "blanks": tuple(name.replace("_", " ") for name in UNITS),
    "dashes": tuple(name.replace("_", "-") for name in UNITS),
    "target": ("Time", "Target Angle", "Feedback Angle", "Motor Feedback Angle", "Target Speed",
               "Feedback Speed", "Target Current", "Feedback Current"),
    "demand": ("time", "demand", "actual", "resolver angle", "speed demand", "speed",
               "current demand", "current"),
    "numbered": tuple(f"ch{k}" for k in range(len(UNITS))),
    "letters": tuple("ABCDEFGH"),
    "nonsense": ("foo", "bar", "baz", "qux", "quux", "corge", "grault", "garply"),
}  # fmt: skip


@pytest.fixture(scope="module")
def columns():
    """A servo behind a gear, in the units of `UNITS`, with noise and backlash."""
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 12.0, 0.004)
    command = 0.6 * np.sin(2 * np.pi * 0.25 * t) + 0.2 * np.sin(2 * np.pi * 0.7 * t)
    output = np.interp(t - 0.05, t, command)
    speed_ref = 20.0 * RATIO * (command - output)
    motor = RATIO * output + 0.2 * np.sign(np.gradient(output, t))
    speed = np.interp(t - 0.006, t, np.gradient(RATIO * output, t))
    current_ref = 1.5 * np.tanh(speed) + 0.004 * np.gradient(speed, t) + 0.01 * speed
    current = np.interp(t - 0.004, t, current_ref)
    quiet = {"time": 1e3 * t, "command": np.degrees(command)}
    noisy = {
        "output_position": (np.degrees(output), 2e-3),
        "motor_position": (motor / (2 * np.pi), 1e-3),
        "speed_ref": (speed_ref * 30 / np.pi, 0.1),
        "motor_speed": (speed * 30 / np.pi, 1.0),
        "current_ref": (current_ref, 0.0),
        "torque_current": (current, 0.03),
    }
    return quiet | {k: v + rng.normal(0.0, s, len(t)) for k, (v, s) in noisy.items()}


def renamed(columns, names, order):
    pairs = [(f"{name} [{UNITS[role]}]", columns[role])
             for role, name in zip(UNITS, names, strict=True)]  # fmt: skip
    return dict(pairs[k] for k in order)


@pytest.mark.parametrize("shuffled", [False, True])
def test_other_names_give_the_same_log_or_a_question(columns, shuffled):
    order = np.random.default_rng(1).permutation(len(UNITS)) if shuffled else range(len(UNITS))
    reference = read_log(renamed(columns, STYLES["own"], range(len(UNITS))))
    questioned = []
    for style, names in STYLES.items():
        try:
            log = read_log(renamed(columns, names, order))
        except QuestionError:
            questioned.append(style)
            continue
        assert set(log.channels) == set(UNITS) - {"time"}, style
        assert np.array_equal(log.time, reference.time), style
        for role in reference:
            assert np.array_equal(log[role], reference[role], equal_nan=True), (style, role)
    assert len(questioned) <= 0.1 * len(STYLES), questioned


def test_a_commanded_current_is_never_the_current(columns):
    given = renamed(columns, STYLES["moteus"], range(7))
    log = read_log(given)
    assert log.has("current_ref")
    assert not log.has("torque_current")


def test_several_drives_are_asked_for_and_one_is_taken(columns):
    given = {"time [ms]": columns["time"]}
    for drive in ("a1", "a2"):
        given |= {f"{drive} {role} [{UNITS[role]}]": columns[role] for role in list(UNITS)[1:]}
    with pytest.raises(QuestionError, match=r"a1, a2; say --drive NAME"):
        read_log(given)
    assert np.array_equal(
        read_log(given, drive="a2").output, np.radians(columns["output_position"])
    )


def test_a_role_that_is_said_wins(columns):
    table = RawTable("x", {f"ch{k}": columns[role] for k, role in enumerate(UNITS)})
    guess = guess_map(table, answers={"output_position": "ch1"})
    assert {c.name: c.role for c in guess.columns}["ch1"] == "output_position"


@pytest.mark.parametrize("kind", ["pandas", "polars", "xarray", "masked"])
def test_columns_in_memory_are_read_as_a_file_is(columns, kind):
    given = renamed(columns, STYLES["english"], range(len(UNITS)))
    hole = np.zeros(len(columns["time"]), dtype=bool)
    hole[100:110] = True
    name = "Motor current [A]"
    expected = {**given, name: np.where(hole, np.nan, given[name])}
    if kind == "masked":
        frame = {**given, name: np.ma.masked_array(given[name], hole)}
    elif kind == "xarray":
        xarray = pytest.importorskip("xarray")
        frame = xarray.Dataset({n: ("row", v) for n, v in expected.items()})
    else:
        frame = pytest.importorskip(kind).DataFrame(expected)
    log, plain = read_log(frame), read_log(expected)
    assert np.isnan(log["torque_current"][100:110]).all()
    for role in plain:
        assert np.array_equal(log[role], plain[role], equal_nan=True)


def test_rows_that_are_missing_do_not_count(columns):
    given = renamed(columns, STYLES["own"], range(len(UNITS)))
    kept = np.ones(len(columns["time"]), dtype=bool)
    kept[[50, 51, 700]] = False
    whole = read_log(given)
    log = read_log({name: values[kept] for name, values in given.items()})
    assert np.array_equal(np.flatnonzero(~log.good), [50, 51, 700])
    np.testing.assert_allclose(log.time, whole.time, atol=1e-12)
    assert np.array_equal(log.output[log.good], whole.output[kept])
    assert np.isnan(log.output[~log.good]).all()
