"""What each fault looks like: healthy beside faulty, in time and in spectrum, for each actuator.

No published figure: the gallery answers "what would I see?" for the whole catalogue.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.data import read_table
from elevon.errors import InputError
from elevon.faults import FaultRecord, catalogue
from elevon.plain import fields_of, key
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.report import Check, Report, ReportTable
from elevon.report.checks import CheckedResult
from elevon.report.figures import COLOURS, new_figure
from elevon.scenario import Scenario
from elevon.simulate import Run, simulate_batch
from elevon.units import display_unit, format_quantity, to_display

if TYPE_CHECKING:
    from matplotlib.figure import Figure


ACTUATORS = ("torino-rotary", "nasa-ballscrew", "pisa-landing-gear")
RATE = 2000.0

#: Severity shown, SI, by kind, or kind and unit; every other kind at its most.
_SEVERITIES = {row["kind"]: float(row["severity"]) for row in read_table("fault_gallery")}
#: What a fault needs of its actuator to show at all; the healthy unit beside it has the same.
_GIVEN: Mapping[str, Mapping[str, str]] = {
    "connector_open": {"inverter.link_capacitance": "470 uF"},
}
#: A failed release cable shows in no extension and no retraction: nobody pulls it.
_SILENT = 1.0
_SIGNALS = (
    "output_position",
    "encoder_position",
    "motor_speed",
    "current_q",
    "current_q_meas",
    "current_mean",
    "motor_torque",
)


@dataclass(frozen=True)
class Signature:
    """One fault beside the healthy unit.

    Attributes
    ----------
    actuator, kind, place : str
        Which, where: the first place of the catalogue; `places` has all.
    severity : float
        In `unit`.
    status : str
        Of the faulty run.
    changes : mapping of str to float
        Signal to the rms difference from the healthy run, over the healthy one's rms about its
        mean.
    time : ndarray, shape (n,)
        s.
    signal : str
        The signal whose change is the largest.
    healthy, faulty : ndarray, shape (n,)
        That signal, SI.
    """

    actuator: str
    kind: str
    place: str
    places: tuple[str, ...]
    severity: float
    unit: str
    effect: str
    status: str
    changes: Mapping[str, float]
    time: Floats
    signal: str
    healthy: Floats
    faulty: Floats

    def to_dict(self) -> dict[str, object]:
        """Return the row."""
        names = ("actuator", "kind", "place", "severity", "unit", "status", "signal")
        changes = {f"change_{name}": self.changes.get(name) for name in _SIGNALS}
        return fields_of(self, *names) | changes


@dataclass(frozen=True)
class SignaturesResult(CheckedResult):
    """The gallery."""

    signatures: Annotated[tuple[Signature, ...], key("rows")]

    @property
    def checks(self) -> list[Check]:
        """Return what must hold: no run left the numbers; what leaves no trace is counted."""
        diverged = sum(item.status == "diverged" for item in self.signatures)
        silent = [i for i in self.signatures if max(i.changes.values(), default=0.0) < 1e-6]
        return [
            Check("faults whose run diverged", float(diverged), 0.0, "faults"),
            Check("faults without any trace", float(len(silent)), _SILENT, "faults"),
        ]


def reproduce_signatures(
    actuators: tuple[str, ...] = ACTUATORS,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> SignaturesResult:
    """Run every kind of fault of some actuators at high fidelity, each beside the healthy unit.

    Errors as `simulate_batch`.
    """
    signatures: list[Signature] = []
    for number, name in enumerate(actuators):
        start, share = number / len(actuators), 1.0 / len(actuators)

        def part(fraction: float, start: float = start, share: float = share) -> bool:
            return progress is None or progress(start + share * fraction) is not False

        signatures += _gallery(_quiet(Actuator.load(name)), seed, part)
    return SignaturesResult(tuple(signatures))


def _gallery(actuator: Actuator, seed: int, progress: Progress) -> list[Signature]:
    scenario = _motion(actuator)
    records = [r for r in catalogue(actuator.wiring) if "high" in r.fidelities]
    by_kind = {record.kind: record for record in reversed(records)}
    faults = [(record, record.places[0], _severity(record)) for record in by_kind.values()][::-1]
    runs = []
    for record, place, severity in faults:
        unit = actuator.with_values(_GIVEN.get(record.kind, {}))
        runs.append(Run(unit, _with(scenario, record, place, severity), seed))
    units = {run.actuator.hash: run.actuator for run in runs}
    runs += [Run(unit, scenario, seed) for unit in units.values()]
    signals = _recorded(actuator)
    record_text = f"{','.join(signals)}@{RATE:g} Hz"
    answers = simulate_batch(runs, record=record_text, progress=progress)
    healthy = dict(zip(units, answers[len(faults) :], strict=True))
    return [
        _signature(actuator, fault, healthy[run.actuator.hash], answer)
        for fault, run, answer in zip(faults, runs, answers, strict=False)
    ]


def _quiet(actuator: Actuator) -> Actuator:
    """Return the actuator with a carrier-PWM drive where it has the choice.

    The ripple of hysteresis relays is chaotic: it differs between any two runs and hides the rest.
    """
    return actuator.with_values(
        {"drive.kind": "pwm"} if "drive.kind" in actuator.parameters else {}
    )


def _recorded(actuator: Actuator) -> list[str]:
    from elevon.scenario.compile import signal_records

    known = signal_records(actuator.wiring, "high")
    return [name for name in _SIGNALS if name in known]


def _motion(actuator: Actuator) -> Scenario:
    """Return a motion that shows faults: a sine both ways against a load; a gear's own cycle."""
    default_scenario = Scenario.from_dict(dict(actuator.default_scenario or {}), actuator.name)
    if default_scenario.command.mode == "gear":
        steps = [{"time": "0.1 s", "action": "extend"}, {"time": "9 s", "action": "retract"}]
        return Scenario.from_dict({"duration": "18 s", "command": {"mode": "gear", "steps": steps}})
    linear = "m" if "screw.lead" in actuator.parameters else "deg"
    size, load = ("20 mm", "2000 N") if linear == "m" else ("7 deg", "20 N m")
    sine = {"kind": "sine", "amplitude": size, "frequency": "1 Hz"}
    return Scenario.from_dict(
        {
            "duration": "2 s",
            "command": {"terms": [sine]},
            "load": {"output": {"terms": [{"kind": "constant", "value": load}]}},
        }
    )


def _severity(record: FaultRecord) -> float:
    for name in (f"{record.kind} {record.unit}", record.kind):
        if name in _SEVERITIES:
            return min(_SEVERITIES[name], record.maximum)
    if not np.isfinite(record.maximum):
        raise InputError(f"{record.kind} [{record.unit}]: the gallery knows no severity to show")
    return record.maximum


def _with(scenario: Scenario, record: FaultRecord, place: str, severity: float) -> Scenario:
    onset = {"kind": "step", "time": 0.25 * scenario.seconds}
    fault = {"kind": record.kind, "place": place, "severity": severity, "profile": onset}
    return scenario.with_faults([fault])


def _signature(
    actuator: Actuator,
    fault: tuple[FaultRecord, str, float],
    healthy: Recording,
    faulty: Recording,
) -> Signature:
    record, place, severity = fault
    changes = {name: _change(healthy[name].values, faulty[name].values) for name in healthy.names}
    clearest = max(changes, key=lambda name: changes[name])
    count = len(faulty[clearest])
    return Signature(
        actuator=actuator.name,
        kind=record.kind,
        place=place,
        places=record.places,
        severity=severity,
        unit=record.unit,
        effect=record.effect,
        status=faulty.status,
        changes=changes,
        time=healthy[clearest].time[:count],
        signal=clearest,
        healthy=healthy[clearest].values[:count],
        faulty=faulty[clearest].values,
    )


def _change(healthy: Floats, faulty: Floats) -> float:
    count = min(healthy.size, faulty.size)
    spread = float(np.std(healthy)) or 1.0
    return float(np.sqrt(np.mean((faulty[:count] - healthy[:count]) ** 2)) / spread)


def signatures_page(result: SignaturesResult, date: str | None = None) -> Report:
    """Return the page: for each actuator a map of what changes, then fault by fault."""
    report = Report("What each fault looks like", date=date)
    report.lead = (
        f"{len(result.signatures)} faults, each beside the healthy unit of the same run: high "
        "fidelity, carrier-PWM drive where there is one, one place a kind, from a quarter of "
        "the run on. The severities are chosen to be plainly visible."
    )
    names = list(dict.fromkeys(item.actuator for item in result.signatures))
    for name in names:
        mine = [item for item in result.signatures if item.actuator == name]
        section = report.section(name)
        section.figure(
            _map(mine),
            "Rms difference from the healthy run over the healthy signal's spread (logarithmic): "
            "the brighter, the plainer.",
        )
        for item in mine:
            section.heading(f"{item.kind}@{item.place}")
            section.figure(_pair(item), _caption(item))
    section = report.section("All of them")
    section.checks(result.checks)
    rows = [list(item.to_dict().values()) for item in result.signatures]
    section.table(ReportTable(list(result.signatures[0].to_dict()), rows, digits=3))
    return report


def _caption(item: Signature) -> str:
    unit = "%" if item.unit == "1" else display_unit(item.unit)
    severity = format_quantity(item.severity, unit, 3)
    others = f"; also at {', '.join(item.places[1:])}" if len(item.places) > 1 else ""
    return f"{severity}: {item.effect}{others}. Run: {item.status}."


def _map(items: list[Signature]) -> Figure:
    signals = list(items[0].changes)
    values = np.array([[max(item.changes[name], 1e-6) for name in signals] for item in items])
    with new_figure(height=1.2 + 0.2 * len(items), width=7.0) as (figure, axis):
        picture = axis.imshow(np.log10(values), aspect="auto", cmap="viridis", vmin=-4, vmax=1)
        axis.grid(visible=False)
        axis.set_xticks(range(len(signals)), signals, rotation=20, ha="right")
        axis.set_yticks(range(len(items)), [item.kind for item in items], fontsize=7)
        figure.colorbar(picture, label="log10 of the change")
    return figure


def _pair(item: Signature) -> Figure:
    from elevon.recording.plot import Panel, spectrum_panels

    unit = {"motor_speed": "rpm", "motor_torque": "N m"}.get(item.signal, "A")
    scale = float(to_display(1.0, unit)) if unit == "rpm" else 1.0
    if item.signal.endswith("_position"):
        linear = item.actuator != "torino-rotary"
        unit, scale = ("mm", 1e3) if linear else ("deg", float(np.rad2deg(1.0)))
    # The healthy one is wide and lies below: it is seen where both agree, and where they do not.
    looks = {"healthy": {"color": COLOURS["grey"], "lw": 3.0},
             "faulty": {"color": COLOURS["orange"], "lw": 0.9}}  # fmt: skip
    lines = {"healthy": scale * item.healthy, "faulty": scale * item.faulty}
    step = max(item.time.size // 1500, 1)
    with new_figure(1, 2, height=2.3, width_ratios=[3, 2]) as (figure, axes):
        for name, values in lines.items():
            axes[0].plot(item.time[::step], values[::step], label=name, **looks[name])
        for panel in spectrum_panels([Panel(item.signal, unit, item.time, lines)]):
            low = panel.time < 0.45 / (item.time[1] - item.time[0])
            for name, values in panel.lines.items():
                slices = np.unique(np.geomspace(1, low.sum() - 1, 300).astype(int))
                axes[1].loglog(panel.time[slices], values[slices] + 1e-12, **looks[name])
        axes[0].set(xlabel="time [s]", ylabel=f"{item.signal} [{unit}]")
        axes[1].set(xlabel="frequency [Hz]", ylabel=f"[{unit}]")
        figure.legend(loc="outside upper right", ncols=2, fontsize=8)
    return figure
