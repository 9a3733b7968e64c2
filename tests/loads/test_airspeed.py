"""Airspeeds against each other and against independent formulas."""

import numpy as np
import pytest

from elevon.errors import RangeError, UnknownNameError
from elevon.loads import dynamic_pressure, mach_number, standard_atmosphere


def test_true_airspeed_is_half_rho_v2():
    air = standard_atmosphere([0.0, 8_000.0, 15_000.0])
    q = dynamic_pressure([50.0, 200.0, 250.0], "true", air)
    np.testing.assert_allclose(q, 0.5 * air.density * np.array([50.0, 200.0, 250.0]) ** 2)


def test_equivalent_airspeed_is_half_rho0_v2():
    air = standard_atmosphere([0.0, 8_000.0, 15_000.0])
    q = dynamic_pressure(120.0, "equivalent", air)
    np.testing.assert_allclose(q, 0.5 * 1.225 * 120.0**2, rtol=1e-6)


def test_all_kinds_agree_at_sea_level():
    air = standard_atmosphere(0.0)
    speed = 150.0
    kinds = {kind: mach_number(speed, kind, air) for kind in ("true", "equivalent", "calibrated")}
    kinds["mach"] = mach_number(speed / air.speed_of_sound, "mach", air)
    for value in kinds.values():
        assert value == pytest.approx(float(kinds["true"]), rel=1e-7)


def test_calibrated_airspeed_at_altitude():
    """Inverse way: from Mach to impact pressure to the sea-level speed that would make it."""
    air = standard_atmosphere(10_668.0)  # flight level 350
    mach = 0.78
    impact = air.pressure * ((1.0 + 0.2 * mach**2) ** 3.5 - 1.0)
    calibrated = 340.294 * np.sqrt(5.0 * ((impact / 101_325.0 + 1.0) ** (2.0 / 7.0) - 1.0))
    assert mach_number(calibrated, "calibrated", air) == pytest.approx(mach, rel=1e-6)


def test_calibrated_above_mach_one():
    with pytest.raises(RangeError, match=r"sample 1 means Mach .* above 1"):
        mach_number([100.0, 300.0], "calibrated", standard_atmosphere(12_000.0))


@pytest.mark.parametrize("speed", [-1.0, float("nan"), float("inf")])
def test_impossible_speed(speed):
    with pytest.raises(RangeError, match="airspeed"):
        mach_number([1.0, speed], "true", standard_atmosphere(0.0))


def test_unknown_kind():
    with pytest.raises(UnknownNameError, match="'calibrated'"):
        mach_number(1.0, "calibratd", standard_atmosphere(0.0))
