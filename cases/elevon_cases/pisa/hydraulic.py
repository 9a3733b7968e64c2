"""An open-loop hydraulic leg actuator beside the electromechanical one (P eqs. 1 and 2).

The cylinder's speed follows from the supply pressure, the load and a restrictor; oil density and
restrictor loss depend on temperature. Nothing closes a loop on speed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from elevon.plain import WORKING, Plain
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.report import Report
from elevon.report.checks import Check, CheckedResult
from elevon.report.figures import new_figure
from elevon_cases.page import BLUE, GREEN, GREY, ORANGE, table_of, with_end
from elevon_cases.pisa.gear import Stroke, run_strokes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


TEMPERATURES = (-40.0, 20.0, 70.0)
FACTORS = (0.0, 1.0, 1.5, 3.5)
SPREAD = 5.0
"""Percent by which load and temperature may move the controlled speed; ASSUMED, P prints none."""
_BOTH = ("motor.winding_temperature", "lubricant.temperature")


@dataclass(frozen=True, slots=True)
class HydraulicActuator:
    """Cylinder, restrictor and oil, SI; every number ASSUMED, as P prints none.

    Attributes
    ----------
    supply_pressure : float
        Pa; a light helicopter's system, 1500 psi class.
    piston_area : float
        m2; 8.24 kN at that pressure, above the 6.98 kN of the critical load.
    restrictor_diameter : float
        m; 50 mm/s at 20 C without load, the high speed of the electromechanical actuator.
    restrictor_loss : float
        Loss coefficient at high Reynolds number; a sharp orifice, ``1/0.61**2``.
    restrictor_reynolds : float
        Reynolds number at which the loss has doubled; a short bore, order of magnitude.
    density, expansion : float
        kg/m3 at 20 C and 1/K; mineral hydraulic oil.
    viscosity_40, viscosity_100 : float
        m2/s; MIL-PRF-5606 class, Walther's rule between.
    """

    supply_pressure: float = 10.3e6
    piston_area: float = 8e-4
    restrictor_diameter: float = 0.75e-3
    restrictor_loss: float = 2.7
    restrictor_reynolds: float = 250.0
    density: float = 860.0
    expansion: float = 8e-4
    viscosity_40: float = 14e-6
    viscosity_100: float = 5e-6

    def oil_density(self, temperature: float) -> float:
        """Return the density in kg/m3 at a temperature in degrees Celsius."""
        return self.density * (1.0 - self.expansion * (temperature - 20.0))

    def viscosity(self, temperature: float) -> float:
        """Return the kinematic viscosity in m2/s by Walther's rule (ASTM D341)."""

        def w(viscosity: float) -> float:
            return math.log10(math.log10(1e6 * viscosity + 0.7))

        t40, t100 = math.log10(313.15), math.log10(373.15)
        slope = (w(self.viscosity_40) - w(self.viscosity_100)) / (t100 - t40)
        exponent = w(self.viscosity_40) + slope * (t40 - math.log10(temperature + 273.15))
        return float(1e-6 * (10.0 ** (10.0**exponent) - 0.7))

    def speed(self, force: float, temperature: float) -> float:
        """Return the ram speed in m/s under a force in N that aids when positive; 0 when stalled.

        ``p = (1/2) rho K_s u^2`` with ``K_s = K (1 + Re_c/Re)``, ``Re = u d/nu``: a quadratic in
        the jet speed u.
        """
        pressure = self.supply_pressure + force / self.piston_area
        if pressure <= 0.0:
            return 0.0
        d = self.restrictor_diameter
        b = self.restrictor_reynolds * self.viscosity(temperature) / d
        head = 8.0 * pressure / (self.oil_density(temperature) * self.restrictor_loss)
        jet = 0.5 * (math.sqrt(b * b + head) - b)
        return jet * 0.25 * math.pi * d * d / self.piston_area


@dataclass(frozen=True, slots=True)
class HydraulicRow(Plain):
    """Speeds in mid-stroke at one temperature, load factor and direction, and line currents.

    Of the electromechanical actuator with winding and lubricant at the temperature, and with the
    winding alone: then cold helps it.
    """

    temperature_c: float
    nz: float
    direction: str
    hydraulic_mm_s: float
    electric_mm_s: float
    electric_winding_mm_s: float
    electric_a: float
    electric_winding_a: float


@dataclass(frozen=True)
class HydraulicResult(CheckedResult):
    """Everything `elevon reproduce pisa-hydraulic` reports."""

    rows: list[HydraulicRow]
    checks: list[Check]
    temperatures: Annotated[tuple[float, ...], WORKING] = TEMPERATURES


def reproduce_hydraulic(
    *, hydraulic: HydraulicActuator | None = None, progress: Progress | None = None
) -> HydraulicResult:
    """Compare both actuators at mid-stroke over load and temperature.

    The electromechanical one runs at 28 V with its winding and its lubricant at the temperature,
    and again with the winding alone; its speed is read where the ram passes the middle of the
    stroke.
    """
    leg = hydraulic or HydraulicActuator()
    cases = [
        (temperature, factor, action)
        for temperature in TEMPERATURES
        for factor in FACTORS
        for action in ("extend", "retract")
    ]
    strokes = [
        Stroke(action, factor, 28.0, dict.fromkeys(paths, temperature + 273.15))
        for paths in (_BOTH, _BOTH[:1])
        for temperature, factor, action in cases
    ]
    runs = run_strokes(strokes, fidelity="low", progress=progress)
    whole, winding = runs[: len(cases)], runs[len(cases) :]
    rows = []
    for (temperature, factor, action), run, other in zip(cases, whole, winding, strict=True):
        speed, load, current = _middle(run)
        bare = _middle(other)
        sign = 1.0 if action == "extend" else -1.0
        rows.append(
            HydraulicRow(
                temperature,
                factor,
                "extension" if action == "extend" else "retraction",
                1e3 * leg.speed(sign * load, temperature),
                1e3 * abs(speed),
                1e3 * abs(bare[0]),
                current,
                bare[2],
            )
        )
    return HydraulicResult(rows, _checks(rows))


def _middle(run: Recording) -> tuple[float, float, float]:
    """Ram speed in m/s over the middle tenth of the stroke; load in N and current in A there."""
    ram = run["output_position"]
    within = (ram.values > 0.119) & (ram.values < 0.145)
    time, place = ram.time[within], ram.values[within]
    if time.size < 2:
        return 0.0, float("nan"), float("nan")
    return (
        float((place[-1] - place[0]) / (time[-1] - time[0])),
        float(run["load_force"].values[within].mean()),
        float(run["current_mean"].values[within].mean()),
    )


def _spread(rows: Sequence[HydraulicRow], name: str) -> float:
    speeds = np.array([getattr(row, name) for row in rows])
    return float(100.0 * (speeds.max() - speeds.min()) / speeds.mean())


def _checks(rows: Sequence[HydraulicRow]) -> list[Check]:
    """Both directions alike: the controlled speed holds over load and temperature, oil does not."""
    checks = []
    for direction in ("retraction", "extension"):
        mine = [row for row in rows if row.direction == direction]
        electric, hydraulic, winding = (
            _spread(mine, f"{name}_mm_s") for name in ("electric", "hydraulic", "electric_winding")
        )
        checks += [
            Check(f"{direction}, spread of the controlled speed", electric, SPREAD, "%"),
            Check(f"{direction}, the same with the winding's temperature alone", winding, SPREAD,
                  "%"),
            Check(f"{direction}, spread of the hydraulic speed", hydraulic, electric, "%",
                  at_least=True),
        ]  # fmt: skip
    return checks


def hydraulic_page(result: HydraulicResult, date: str | None = None) -> Report:
    """Return the report of both actuators."""
    report = Report(
        "Open-loop hydraulics and controlled speed",
        "Speed of the ram in mid-stroke over load and temperature: a hydraulic cylinder behind a "
        "restrictor, and the electromechanical actuator under its speed control.",
        date=date,
    )
    columns = (
        ("Temperature [C]", "temperature_c", ".0f"),
        ("Load factor", "nz", ".1f"),
        ("Direction", "direction"),
        ("Hydraulic [mm/s]", "hydraulic_mm_s", ".1f"),
        ("Electromechanical [mm/s]", "electric_mm_s", ".1f"),
        ("Winding alone [mm/s]", "electric_winding_mm_s", ".1f"),
        ("Current [A]", "electric_a", ".1f"),
        ("Winding alone [A]", "electric_winding_a", ".1f"),
    )
    report.section("Speeds").figure(
        _speeds_figure(result), "Speed over load factor, one line a temperature."
    ).text(
        "Temperature reaches the oil, and in the electromechanical actuator the winding, the "
        "friction tables and the efficiencies (curves ASSUMED, set pisa-landing-gear). With the "
        "winding alone cold would help the motor, and the small spread would be so by "
        "construction."
    ).table(table_of(result.rows, columns, "Extension aids the load, retraction lifts it."))
    return with_end(report, result.checks, "pisa-hydraulic")


def _speeds_figure(result: HydraulicResult) -> Figure:
    with new_figure(1, 2) as (figure, both):
        for axes, direction in zip(both, ("extension", "retraction"), strict=True):
            for temperature, colour in zip(result.temperatures, (BLUE, ORANGE, GREEN), strict=True):
                place = (direction, temperature)
                rows = [r for r in result.rows if (r.direction, r.temperature_c) == place]
                factors, label = [row.nz for row in rows], f"hydraulic, {temperature:g} C"
                speeds = [row.hydraulic_mm_s for row in rows]
                axes.plot(factors, speeds, "o-", ms=3, color=colour, label=label)
                axes.plot(factors, [row.electric_mm_s for row in rows], "x--", color=colour)
            axes.set(xlabel="Load factor", title=direction, ylim=(0, None))
        both[0].set(ylabel="Ram speed [mm/s]")
        both[0].plot([], [], "x--", color=GREY, label="electromechanical, 28 V")
        both[0].legend()
    return figure
