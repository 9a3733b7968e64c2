"""The atmosphere against the printed tables of the U.S. Standard Atmosphere 1976."""

import numpy as np
import pytest

from elevon.errors import RangeError
from elevon.loads import standard_atmosphere

# geopotential altitude m, temperature K, pressure Pa, density kg/m3: U.S. Standard Atmosphere 1976,
# whose gas constant is 7e-7 above ISO 2533's; over 4.8 scale heights that is 3.4e-6 of pressure.
LAYER_FEET = [
    (0.0, 288.15, 101_325.0, 1.225),
    (11_000.0, 216.65, 22_632.06, 0.363918),
    (20_000.0, 216.65, 5_474.889, 0.0880349),
    (32_000.0, 228.65, 868.0187, 0.0132250),
]
# geometric altitude m, T K, p Pa, rho kg/m3, a m/s: U.S. Standard Atmosphere 1976, tables I, III.
GEOMETRIC = [
    (1_000.0, 281.651, 8.9876e4, 1.1117, 336.43),
    (5_000.0, 255.676, 5.4048e4, 7.3643e-1, 320.55),
    (10_000.0, 223.252, 2.6500e4, 4.1351e-1, 299.53),
    (15_000.0, 216.650, 1.2112e4, 1.9476e-1, 295.07),
    (20_000.0, 216.650, 5.5293e3, 8.8910e-2, 295.07),
    (25_000.0, 221.552, 2.5492e3, 4.0084e-2, 298.39),
    (30_000.0, 226.509, 1.1970e3, 1.8410e-2, 301.71),
]


@pytest.mark.parametrize(("height", "temperature", "pressure", "density"), LAYER_FEET)
def test_layer_feet(height, temperature, pressure, density):
    air = standard_atmosphere(height)
    assert air.temperature == pytest.approx(temperature, abs=1e-9)
    assert air.pressure == pytest.approx(pressure, rel=4e-6)
    assert air.density == pytest.approx(density, rel=6e-6)


@pytest.mark.parametrize(("height", "temperature", "pressure", "density", "sound"), GEOMETRIC)
def test_geometric_altitudes(height, temperature, pressure, density, sound):
    air = standard_atmosphere(height, geometric=True)
    assert air.temperature == pytest.approx(temperature, abs=6e-4)
    assert air.pressure == pytest.approx(pressure, rel=6e-5)
    assert air.density == pytest.approx(density, rel=6e-5)
    assert air.speed_of_sound == pytest.approx(sound, abs=6e-3)


def test_below_sea_level():
    air = standard_atmosphere(-2_000.0)  # ISO 2533: 301.15 K, 127 774 Pa
    assert air.temperature == pytest.approx(301.15)
    assert air.pressure == pytest.approx(127_774.0, rel=2e-5)


def test_hydrostatic_equilibrium_everywhere():
    """dp/dH = -g rho, by central differences, which knows nothing of the layers' formulas."""
    height = np.linspace(-1_900.0, 31_900.0, 991)
    step = 1.0
    above, below = standard_atmosphere(height + step), standard_atmosphere(height - step)
    slope = (above.pressure - below.pressure) / (2.0 * step)
    expected = -9.80665 * standard_atmosphere(height).density
    np.testing.assert_allclose(slope, expected, rtol=2e-5)


def test_pressure_is_continuous_at_the_layers():
    for foot in (11_000.0, 20_000.0):
        below, above = standard_atmosphere([foot - 1e-6, foot + 1e-6]).pressure
        assert below == pytest.approx(above, rel=1e-9)


def test_warm_day_keeps_the_pressure():
    standard = standard_atmosphere(3_000.0)
    warm = standard_atmosphere(3_000.0, temperature_offset=15.0)
    assert warm.pressure == standard.pressure
    ratio = standard.temperature / (standard.temperature + 15.0)
    assert warm.density == pytest.approx(standard.density * ratio)


def test_shape_is_kept():
    assert standard_atmosphere(np.zeros((2, 3))).density.shape == (2, 3)


@pytest.mark.parametrize("height", [32_000.5, -2_001.0, float("nan"), float("inf")])
def test_outside(height):
    with pytest.raises(RangeError, match=r"sample 1 .*-2000 to 32000 m"):
        standard_atmosphere([0.0, height])


@pytest.mark.parametrize("offset", [float("nan"), -101.0])
def test_wrong_offset(offset):
    with pytest.raises(RangeError, match="temperature_offset"):
        standard_atmosphere(0.0, temperature_offset=offset)
