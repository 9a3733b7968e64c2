import functools
import math

import numpy as np
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from elevon.errors import InputError, RangeError, UnitError
from elevon.units import (
    check_kind,
    convert,
    format_quantity,
    kind_name,
    known_units,
    parse_quantity,
    parse_unit,
    si_unit,
    to_display,
    to_si,
)
from elevon.units.unit import KINDS, PREFIXES, SYMBOLS, WORDS


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("45 deg", "rad", math.radians(45)),
        ("7.7 kg cm2", "kg m2", 7.7e-4),
        ("500 rpm", "rad/s", 500 * math.pi / 30),
        ("121 V/krpm", "V s/rad", 121 / (1000 * math.pi / 30)),
        ("30.5 mH", "H", 30.5e-3),
        ("0.0614 N/mm", "N/m", 61.4),
        ("20 degC", "K", 293.15),
        ("20 °C", "K", 293.15),
        ("68 degF", "K", 293.15),
        ("0.5 W/degC", "W/K", 0.5),
        ("0.39 %/K", "1/K", 0.0039),
        ("5 %", "1", 0.05),
        ("1 lbf", "N", 4.4482216152605),
        ("2 kgf", "N", 19.6133),
        ("3 kΩ", "ohm", 3000.0),
        ("12 µs", "s", 12e-6),
        ("2 m²", "m2", 2.0),
        ("4 N·m·s/rad", "N m s/rad", 4.0),
        ("2 W/(m K)", "W/(m K)", 2.0),
        ("3 s^-1", "1/s", 3.0),
        ("3 m**2", "m2", 3.0),
        ("5 mm/rev", "m/rad", 0.005 / (2 * math.pi)),
        ("-1e-3", "kg m2", -1e-3),
        ("+.5rad", "rad", 0.5),
        ("1 lbf in", "N m", 4.4482216152605 * 0.0254),
        ("1 slug ft2", "kg m2", 1.3558179483314003),
    ],
)
def test_quantities(text, kind, value):
    assert parse_quantity(text, kind) == pytest.approx(value, rel=4e-16)


@pytest.mark.parametrize("text", ["7.7 kg cm2", "0.77 kg cm2", "2.675 kg cm2", "1.91 kg cm2"])
def test_decimal_units_do_not_round_twice(text):
    number = text.split(" ")[0]
    assert parse_quantity(text, "kg m2") == float(number + "e-4")


def test_plain_numbers_are_in_the_expected_unit():
    assert parse_quantity(0.5, "rad") == 0.5
    assert parse_quantity("0.5", "rad") == 0.5
    assert parse_quantity(7, "1") == 7.0
    assert parse_quantity(np.float64(2.5), "s") == 2.5
    assert parse_quantity("30", "deg") == pytest.approx(math.pi / 6)


@pytest.mark.parametrize(
    ("text", "kind", "fragments"),
    [
        ("3 s", "kg m2", ["motor.x", "'s' is a time", "expected an inertia (kg m2)"]),
        ("5 Hz", "rad/s", ["'Hz' is a frequency", "an angular speed (rad/s)"]),
        ("5 N m", "N m/rad", ["a torque", "a torsional stiffness"]),
        ("5 deg", "1", ["an angle", "dimensionless"]),
        ("20 C", "K", ["an electric charge", "a temperature", "degC"]),
        ("3 degg", "rad", ["unknown unit 'degg'", "'deg'", "an angle"]),
        ("3 kgm2", "kg m2", ["unknown unit 'kgm2'", "'kg m2'"]),
        ("3 RPM", "rad/s", ["unknown unit 'RPM'", "'rpm'"]),
        ("3 W/m K", "W/(m K)", ["ambiguous", "W/(m K)"]),
        ("3 dB", "1", ["unknown unit 'dB'"]),
        ("3 c", "m/s", ["unknown unit 'c'"]),
        ("3 pi", "1", ["unknown unit 'pi'"]),
        ("2 (m", "m", ["is not a unit"]),
        ("2 //", "m", ["ambiguous"]),
        ("2 m m m m m m m m m m m m m m m m m m m m m m m m m m m m m m m m", "m", ["longer"]),
    ],
)
def test_wrong_units_name_the_place_the_unit_and_what_is_expected(text, kind, fragments):
    with pytest.raises(UnitError) as caught:
        parse_quantity(text, kind, place="motor.x")
    for fragment in ["motor.x", *fragments]:
        assert fragment in str(caught.value)


@pytest.mark.parametrize(
    "text", ["nan", "NaN rad", "inf", "-inf rad", "Infinity", "1e999 rad", math.nan, math.inf]
)
def test_numbers_that_are_not_finite_are_refused(text):
    with pytest.raises(RangeError, match=r"load\.x.*not a finite number"):
        parse_quantity(text, "rad", "load.x")


@pytest.mark.parametrize(
    "text", ["", " ", "rad", "1,5 rad", "1_000", "1.2.3 rad", "0x10", "--1", "1" * 200, True, None]
)
def test_what_is_no_number_is_refused(text):
    with pytest.raises(InputError):
        parse_quantity(text, "rad", "load.x")


def test_huge_integers_and_exponents_are_refused_at_once():
    with pytest.raises(RangeError):
        parse_quantity(10**400, "1")
    with pytest.raises(RangeError):
        parse_quantity("1e400000000 A", "A")
    assert parse_quantity("1e-400000000 A", "A") == 0.0


@functools.cache
def _pint():
    """Another table of units; its angle is made a dimension, as ours."""
    registry = pint.UnitRegistry(on_redefinition="ignore", cache_folder=None)
    registry.define("radian = [angle] = rad")
    registry._build_cache()
    return registry


_OTHER_NAMES = {
    "1": "dimensionless",
    "%": "percent",
    "grad": "grade",
    "rev": "revolution",
    "rps": "revolution / second",
    "krpm": "1000 * rpm",
    "Nm": "newton * meter",
    "VA": "volt * ampere",
    "lbm": "pound",
    "gramme": "gram",
    "gn": "standard_gravity",
    "klbf": "kilopound_force",
    "gf": "gram_force",
    "kp": "kilogram_force",
    "Ncm": "newton * centimeter",
    "hp": "foot * pound_force * 550 / second",
    "PS": "metric_horsepower",
    "kip": "1000 * force_pound",
    "inHg": "inch_Hg",
    "mmHg": "millimeter_Hg",
    "Wh": "watt * hour",
    "Ah": "ampere * hour",
    "BTU": "Btu",
}
_DIMENSIONS = ("[length]", "[mass]", "[time]", "[current]", "[temperature]", "[angle]")


@pytest.mark.parametrize(
    "name",
    [*SYMBOLS, *(f"{prefix}m" for prefix in PREFIXES), *WORDS, "kohm", "MPa"],
)
def test_the_table_agrees_with_another(name):
    ours, registry = parse_unit(name), _pint()
    one = registry.parse_expression(_OTHER_NAMES.get(name, name))
    zero = registry.Quantity(0.0, one.units).to_base_units()
    size = one.to_base_units() - zero
    powers = dict(size.dimensionality)
    assert ours.dimension == tuple(int(powers.pop(key, 0)) for key in _DIMENSIONS)
    assert not powers
    assert ours.factor == pytest.approx(size.magnitude, rel=1e-6 if "Hg" in name else 1e-9)
    assert float(ours.offset) == pytest.approx(zero.magnitude, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("100 nF", "F", 1e-7),
        ("50 uohm", "ohm", 5e-5),
        ("2 mNm", "N m", 2e-3),
        ("3 Ncm", "N m", 0.03),
        ("3000 psi", "Pa", 3000 * 4.4482216152605 / 0.0254**2),
        ("10 ozf in", "N m", 10 * 4.4482216152605 / 16 * 0.0254),
        ("250 knots", "m/s", 250 * 1852 / 3600),
        ("5 gn", "m/s2", 49.03325),
        ("30 degrees", "rad", math.pi / 6),
        ("2 volts", "V", 2.0),
        ("100 msec", "s", 0.1),
        ("2.5 kVA", "W", 2500.0),
        ("30 arcsec", "rad", math.radians(30 / 3600)),
    ],
)
def test_symbols_of_datasheets(text, kind, value):
    assert parse_quantity(text, kind) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text", ["mmm", "kkg", "kdeg", "mrpm", "Mmin", "k", "M", "kft", "m%", "k1"]
)
def test_a_prefix_stands_before_si_symbols_only(text):
    with pytest.raises(UnitError, match="unit"):
        parse_unit(text)


def test_every_kind_reads_and_no_two_kinds_are_the_same():
    dimensions = [parse_unit(example).dimension for _, example in KINDS]
    assert len(set(dimensions)) == len(dimensions)
    for name, example in KINDS:
        assert kind_name(example) == name
        assert parse_unit(example).factor == 1.0


def test_si_unit():
    assert si_unit("rpm") == "rad/s"
    assert si_unit("mm") == "m"
    assert si_unit("degC") == "K"
    assert si_unit("%") == "1"
    assert parse_unit(si_unit("kg mm3/h")).factor == 1.0


def test_units_of_a_kind():
    assert {"deg", "rad", "arcmin"} <= set(known_units("rad"))
    assert "N" not in known_units("rad")
    assert "N" in known_units()


def test_arrays_convert_and_keep_shape_and_missing_samples():
    values = np.array([[0.0, 90.0], [math.nan, -180.0]])
    result = convert(values, "deg", "rad")
    assert result.shape == (2, 2)
    assert np.isnan(result[1, 0])
    np.testing.assert_allclose(to_display(to_si(values, "deg"), "deg"), values, rtol=1e-15)
    np.testing.assert_allclose(to_display([273.15], "degC"), [0.0])
    assert convert(1.0, "in", "mm") == pytest.approx(25.4)
    with pytest.raises(UnitError):
        convert(1.0, "deg", "m")


def test_convert_to_the_same_unit_gives_a_copy():
    values = np.arange(3.0)
    same = convert(values, "deg", "deg")
    same[0] = 9
    assert values[0] == 0


def test_format():
    assert format_quantity(7.7e-4, "kg cm2") == "7.7 kg cm2"
    assert format_quantity(0.5, "1") == "0.5"


def test_check_kind_returns_the_unit():
    assert check_kind("deg", "rad").factor == pytest.approx(math.pi / 180)


@given(
    st.floats(allow_nan=False, allow_infinity=False, min_value=-1e150, max_value=1e150),
    st.sampled_from(["deg", "mm", "kg cm2", "rpm", "%", "lbf", "kN", "mH", "bar"]),
)
def test_there_and_back(value, unit):
    there = parse_quantity(f"{value!r} {unit}", si_unit(unit))
    assert to_display(there, unit) == pytest.approx(value, rel=1e-14, abs=1e-290)


@given(st.text(max_size=40))
def test_any_text_is_a_number_or_a_clear_error(text):
    try:
        value = parse_quantity(text, "rad", "place")
    except InputError as error:
        assert str(error).startswith("place: ")  # noqa: PT017
    else:
        assert math.isfinite(value)


def test_a_quantity_beyond_its_unit_is_shown_in_si() -> None:
    """1.7e308 rad are no float of degrees."""
    assert format_quantity(-1.7e308, "deg") == "-1.7e+308 (SI)"
