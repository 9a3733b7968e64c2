"""From a CSV file to a load table: signs, scales, and everything that can be wrong."""

import numpy as np
import pytest

from elevon.errors import FormatError, InputError, RangeError, UnitError, UnknownNameError
from elevon.loads import FlightData, HingeMoment, flight_load, read_flight

HEADER = "time [s],altitude [ft],true_airspeed [kt],angle_of_attack [deg],deflection [deg]\n"
ROWS = "0,0,200,2,0\n1,1000,210,3,5\n2,2000,220,4,-5\n"
SURFACE = HingeMoment(area=0.8, chord=0.4, c_alpha=-0.1, c_delta=-0.4)


@pytest.fixture
def write(tmp_path):
    def _write(text, encoding="utf-8"):
        path = tmp_path / "flight.csv"
        path.write_bytes(text.encode(encoding))
        return path

    return _write


def flight(**changes):
    base = {
        "time": [10.0, 11.0, 12.0],
        "altitude": [0.0, 0.0, 0.0],
        "airspeed": [100.0, 100.0, 100.0],
        "airspeed_kind": "true",
        "angle_of_attack": [0.0, 0.0, 0.0],
        "deflection": [0.0, 0.1, -0.2],
    }
    return FlightData(**(base | changes))


def test_read_converts_units(write):
    data = read_flight(write("# a comment\n\n" + HEADER + ROWS))
    np.testing.assert_allclose(data.altitude, [0.0, 304.8, 609.6])
    np.testing.assert_allclose(data.airspeed, np.array([200, 210, 220]) * 1852 / 3600)
    np.testing.assert_allclose(data.deflection, np.radians([0, 5, -5]))
    assert data.airspeed_kind == "true"


def test_read_takes_any_order_and_a_byte_order_mark(write):
    text = "mach [1],deflection [rad],angle_of_attack [rad],altitude [m],time [ms]\n"
    data = read_flight(write("\ufeff" + text + "0.5,0,0,0,0\n0.6,0.1,0,0,500\n"))
    assert data.airspeed_kind == "mach"
    np.testing.assert_allclose(data.time, [0.0, 0.5])


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("", FormatError, "no header"),
        (HEADER, FormatError, "0 rows"),
        (HEADER + "0,0,200,2,0\n", FormatError, "1 rows"),
        (HEADER + "0,0,200,2,0\n1,0,200,2\n", FormatError, ":3: 4 cells"),
        (HEADER + "0,0,200,2,0\n1,0,fast,2,0\n", FormatError, ":3: 'fast' is not a number"),
        (HEADER + "0,0,200,2,0\n0,0,200,2,0\n", InputError, "sample 1"),
        (HEADER + "0,0,200,2,0\n1,0,nan,2,0\n", RangeError, "airspeed"),
        (HEADER + "0,0,200,2,0\n1,0,-3,2,0\n", RangeError, "airspeed"),
        (HEADER + "0,0,200,2,0\n1,0,200,2,91\n", RangeError, "deflection"),
        (HEADER.replace("altitude", "altitud") + ROWS, UnknownNameError, "'altitude'"),
        (HEADER.replace("altitude [ft]", "altitude") + ROWS, FormatError, "has no unit"),
        (HEADER.replace("[ft]", "[kg]") + ROWS, UnitError, "altitude"),
        (HEADER.replace("[ft]", "[fot]") + ROWS, UnitError, "fot"),
        (HEADER.replace("angle_of_attack [deg]", "mach [1]") + ROWS, FormatError, "missing"),
        (HEADER.replace("true_airspeed [kt],", "") + ROWS, FormatError, "airspeed"),
        (HEADER.replace("altitude [ft]", "time [s]") + ROWS, FormatError, "twice"),
    ],
)
def test_bad_files(write, text, error, message):
    with pytest.raises(error) as caught:
        read_flight(write(text))
    assert message in str(caught.value)
    assert "flight.csv" in str(caught.value)


def test_not_utf8(write):
    with pytest.raises(FormatError, match="UTF-8"):
        read_flight(write(HEADER + ROWS + "# température\n", encoding="utf-16"))


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_flight(tmp_path / "none.csv")


def test_load_against_hand_calculation():
    table = flight_load(flight(angle_of_attack=[0.05] * 3), SURFACE, arm=0.1)
    q = 0.5 * 1.225 * 100.0**2
    moment = q * 0.8 * 0.4 * (-0.1 * 0.05 - 0.4 * np.array([0.0, 0.1, -0.2]))
    np.testing.assert_allclose(table.load, -moment / 0.1, rtol=1e-6)
    np.testing.assert_allclose(table.position, [0.0, 0.01, -0.02])
    np.testing.assert_allclose(table.time, [0.0, 1.0, 2.0])


def test_a_stable_surface_opposes_its_deflection():
    table = flight_load(flight(), SURFACE, arm=0.1)
    assert table.load[1] > 0.0 > table.load[2]


def test_a_reversed_arm_changes_both_signs():
    one, other = (flight_load(flight(), SURFACE, arm=arm) for arm in (0.1, -0.1))
    np.testing.assert_array_equal(one.load, -other.load)
    np.testing.assert_array_equal(one.position, -other.position)
    # The work the surface needs does not depend on which way the ram is mounted.
    np.testing.assert_allclose(one.load * one.position, other.load * other.position)


def test_without_arm_the_actuator_is_rotary():
    table = flight_load(flight(), SURFACE)
    np.testing.assert_array_equal(table.position, flight().deflection)


def test_scaling_reaches_the_limit_exactly_and_keeps_the_shape():
    raw = flight_load(flight(), SURFACE, arm=0.1)
    table = flight_load(flight(), SURFACE, arm=0.1, limit=8750.0, travel=0.1)
    assert np.abs(table.load).max() == 8750.0
    assert np.abs(table.position).max() == pytest.approx(0.1)
    np.testing.assert_allclose(table.load, raw.load * table.load_scale)


def test_scenario_terms():
    table = flight_load(flight(), SURFACE, arm=0.1)
    scenario = table.scenario()
    term = scenario["load"]["output"]["terms"][0]
    assert term["kind"] == "table"
    assert term["times"] == [0.0, 1.0, 2.0]
    assert term["values"] == table.load.tolist()
    assert scenario["command"]["terms"][0]["values"] == table.position.tolist()
    assert scenario["duration"] == 2.0


def test_coefficients_over_mach():
    surface = HingeMoment(area=1.0, chord=1.0, c_delta=(-0.2, -0.6), mach=(0.2, 0.6))
    assert surface.moment(1.0, 0.4, 0.0, 1.0) == pytest.approx(-0.4)
    with pytest.raises(RangeError, match=r"0\.7 at sample 0"):
        surface.moment([1.0], [0.7], [0.0], [1.0])


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"area": 0.0, "chord": 1.0}, RangeError),
        ({"area": 1.0, "chord": float("nan")}, RangeError),
        ({"area": 1.0, "chord": 1.0, "c_0": float("inf")}, RangeError),
        ({"area": 1.0, "chord": 1.0, "c_0": (1.0, 2.0)}, InputError),
        ({"area": 1.0, "chord": 1.0, "c_0": (1.0, 2.0), "mach": (0.1, 0.2, 0.3)}, InputError),
        ({"area": 1.0, "chord": 1.0, "c_0": (1.0, 2.0), "mach": (0.2, 0.1)}, InputError),
    ],
)
def test_bad_surfaces(arguments, error):
    with pytest.raises(error):
        HingeMoment(**arguments)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"arm": 0.0}, RangeError, "arm"),
        ({"arm": float("nan")}, RangeError, "arm"),
        ({"limit": 0.0}, RangeError, "limit"),
        ({"travel": -1.0}, RangeError, "travel"),
    ],
)
def test_bad_arguments(arguments, error, message):
    with pytest.raises(error, match=message):
        flight_load(flight(), SURFACE, **arguments)


def test_nothing_to_scale():
    with pytest.raises(InputError, match="zero in the whole flight"):
        flight_load(flight(airspeed=[0.0] * 3), SURFACE, limit=1.0)


@pytest.mark.parametrize(
    "changes",
    [{"deflection": [0.0, 0.1]}, {"time": [0.0], "altitude": [0.0]}, {"airspeed_kind": "ground"}],
)
def test_bad_flights(changes):
    with pytest.raises(InputError):
        flight(**changes)


def test_flight_data_are_frozen_copies():
    deflection = np.array([0.0, 0.1, -0.2])
    data = flight(deflection=deflection)
    deflection[0] = 9.0
    assert data.deflection[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        data.deflection[0] = 1.0
