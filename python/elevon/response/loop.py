"""An open loop measured in closed loop: a command is injected where the loop compares.

With ``y`` the feedback, ``r`` the command and ``e = r - y``, all spectra of one run, the loop
broken at the error is ``L = Y / E``. Both are read against the command, so that noise and what is
not linear bias neither (instrumental variable: T. Soderstrom, P. Stoica, System Identification,
1989).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from elevon.arrays import Complex, Floats
from elevon.errors import InputError, unknown
from elevon.plain import Plain, in_unit, key
from elevon.progress import Progress
from elevon.report import ReportTable
from elevon.response.linear import BodeLines, zero_between
from elevon.response.measure import Excitation, Multisine, frequencies
from elevon.simulate import check_fidelity, solver_step
from elevon.simulate.prepare import ActuatorLike, as_actuator

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.actuator import Actuator
    from elevon.recording import Recording


LEVEL = 0.90
_DRAWS = 400  # of the loop within its deviation: the ends of an interval to a twentieth of it
_KNOWN = 0.3  # relative deviation up to which a line counts: 2.6 dB, 17 degrees
_FINE = 40  # points between two lines, where the loop is interpolated


@dataclass(frozen=True)
class Margin(Plain):
    """One margin.

    Attributes
    ----------
    value : float or None
        In the unit of its name; None where the frequencies measured do not reach it, or the
        deviation leaves it unknown.
    interval : tuple of float or None
        Of 90 %, from the deviation of the loop; None without one.
    frequency : float or None
        Hz at which it is met.
    """

    value: float | None
    interval: tuple[float, float] | None
    frequency: Annotated[float | None, key("frequency_hz"), in_unit("Hz")]


@dataclass(frozen=True)
class Margins(Plain):
    """Margins of a loop ``L`` under negative feedback.

    Attributes
    ----------
    crossover : Margin
        Hz at which the gain falls through one for good.
    phase : Margin
        Degrees that may be lost there.
    gain : Margin
        Decibels that may be gained where the phase passes -180 degrees.
    disk : Margin
        Symmetric disk margin ``alpha``: the least ``2 |1 + L| / |1 - L|``. Gain by a factor between
        ``(2 - alpha)/(2 + alpha)`` and its inverse and phase by ``2 atan(alpha/2)``, at once
        (P. Seiler, A. Packard, P. Gahinet, IEEE Control Systems Magazine 40(5), 2020).
    """

    crossover: Annotated[Margin, key("crossover_hz"), in_unit("Hz")]
    phase: Annotated[Margin, key("phase_margin_deg"), in_unit("deg")]
    gain: Annotated[Margin, key("gain_margin_db"), in_unit("dB")]
    disk: Annotated[Margin, key("disk_margin")]

    COMPUTED: ClassVar = ("interval_level",)
    interval_level: ClassVar = LEVEL


def margins(frequency: Floats, loop: Complex, std: Floats, seed: int = 0) -> Margins:
    """Return the margins of a loop measured at lines.

    Parameters
    ----------
    frequency : ndarray, shape (n,)
        Hz, rising.
    loop : ndarray of complex, shape (n,)
        Open loop.
    std : ndarray, shape (n,)
        Relative deviation of its gain, and of its phase in rad; NaN: no intervals.
    seed : int
        Of the draws within the deviation.
    """
    known = _trusted(std)
    frequency, loop, std = frequency[:known], loop[:known], std[:known]
    draws = []
    if np.isfinite(std).all():
        generator = np.random.default_rng(seed)
        for _ in range(_DRAWS):
            error = generator.normal(size=len(loop)) + 1j * generator.normal(size=len(loop))
            draws.append(loop * np.exp(std * error))
    crossover, phase, gain, disk = (
        _with_interval(reader, frequency, loop, draws)
        for reader in (_crossover, _phase, _gain, _disk)
    )
    return Margins(crossover, phase, gain, disk)


def _trusted(std: Floats) -> int:
    """Return how many lines from the first on are known well enough to read a margin from."""
    unknown = np.flatnonzero(std > _KNOWN)
    return max(int(unknown[0]), 2) if unknown.size else len(std)


_Point = tuple[float, float] | None


def _with_interval(
    reader: Callable[[Floats, Complex], _Point],
    frequency: Floats,
    loop: Complex,
    draws: list[Complex],
) -> Margin:
    """Return a margin; an interval only where nearly all draws reach it, too.

    A value outside of its interval was read at a chance crossing: that margin is not known.
    """
    point = reader(frequency, loop)
    if point is None:
        return Margin(None, None, None)
    values = [item[0] for draw in draws if (item := reader(frequency, draw)) is not None]
    if len(values) < LEVEL * _DRAWS:
        return Margin(point[0], None, point[1])
    low, high = np.quantile(values, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0])
    if not low <= point[0] <= high:
        return Margin(None, (float(low), float(high)), None)
    return Margin(point[0], (float(low), float(high)), point[1])


def _crossover(frequency: Floats, loop: Complex) -> _Point:
    level = np.log(np.abs(loop))
    above = np.flatnonzero(level >= 0.0)
    if not above.size or above[-1] == len(level) - 1:
        return None
    at = zero_between(frequency, level, int(above[-1]))
    return at, at


def _phase(frequency: Floats, loop: Complex) -> _Point:
    point = _crossover(frequency, loop)
    if point is None:
        return None
    phase = np.interp(np.log(point[0]), np.log(frequency), _turned(loop))
    return float(180.0 + np.rad2deg(phase)), point[0]


def _gain(frequency: Floats, loop: Complex) -> _Point:
    """Where the phase passes -180 degrees with the largest gain below one."""
    beyond = _turned(loop) + np.pi
    gain = np.log(np.abs(loop))
    rows = []
    for at in np.flatnonzero((beyond[:-1] >= 0.0) & (beyond[1:] < 0.0)):
        where = zero_between(frequency, beyond, int(at))
        level = float(np.interp(np.log(where), np.log(frequency), gain))
        if level < 0.0:
            rows.append((float(-20.0 / np.log(10.0)) * level, where))
    return min(rows) if rows else None


def _disk(frequency: Floats, loop: Complex) -> _Point:
    grid = np.log(frequency)
    share = np.arange(_FINE) / _FINE
    fine = np.append((grid[:-1, None] + np.diff(grid)[:, None] * share).ravel(), grid[-1])
    between = np.exp(
        np.interp(fine, grid, np.log(np.abs(loop))) + 1j * np.interp(fine, grid, _turned(loop))
    )
    size = 2.0 * np.abs(1.0 + between) / np.maximum(np.abs(1.0 - between), 1e-300)
    at = int(np.argmin(size))
    return float(size[at]), float(np.exp(fine[at]))


def _turned(loop: Complex) -> Floats:
    """Phase in rad, unwrapped, the first line's between -270 and 90 degrees: loops lag."""
    phase = np.unwrap(np.angle(loop))
    first = np.ceil((phase[0] - np.pi / 2.0) / (2.0 * np.pi))
    return np.asarray(phase - 2.0 * np.pi * first)


LOOPS = ("position", "speed", "current")
_LINES = 60  # some twenty in a decade: the phase turns little between two
_COHERENT = 0.95  # below it a loop's margins are those of something else than its linear part
_RANGE = {"position": (0.5, 2000.0), "speed": (0.5, 2000.0), "current": (20.0, 2000.0)}
_SIZE = {"position": ("1 deg", "1 mm"), "speed": ("200 rpm",) * 2, "current": ("2 N m",) * 2}
_SAMPLES = 20


def _margin_text(margin: Margin) -> str:
    unknown = "not known" if margin.interval else "not reached"
    return unknown if margin.value is None else f"{margin.value:.4g}"


@dataclass(frozen=True, kw_only=True)
class LoopResponse(BodeLines):
    """The open loop at each line.

    Attributes
    ----------
    loop : str
        ``position``, ``speed`` or ``current``.
    command, feedback : str
        Signals compared; the response is the feedback over the error.
    feedback_amplitude : float
        Greatest value of the feedback about its mean, SI: with friction, backlash or limits the
        response is the describing function at this amplitude.
    linear : Margins or None
        Margins of the linear loop: measured alike without dry friction and backlash, limits out of
        reach. None where the loop has neither.
    """

    loop: str
    command: str
    feedback: str
    feedback_amplitude: float = float("nan")
    linear: Margins | None = None

    KIND: ClassVar = "loop-response"
    COMPUTED: ClassVar = ("status", "gain_db", "phase_deg", "margins", "hint")
    TABLE: ClassVar = "margins_table"

    @property
    def margins_table(self) -> dict[str, Margin]:
        """The margins by name; beside them those of the linear loop."""
        table = _named(self.margins)
        if self.linear is not None:
            table |= {f"linear: {name}": margin for name, margin in _named(self.linear).items()}
        return table

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        parts = [
            f"{name} {'not reached' if margin.value is None else f'{margin.value:.3g}'}"
            for name, margin in _named(self.margins).items()
        ]
        return f"{self.loop} loop of {self.actuator}: {', '.join(parts)}."

    def text_tables(self) -> list[ReportTable]:
        """Return the margins with their intervals."""
        margins, linear = self.margins, self.linear
        head, rows = ["margin", "value", "low", "high", "unit", "at [Hz]"], []
        for name, field, unit in (
            ("crossover", "crossover", "Hz"),
            ("phase margin", "phase", "deg"),
            ("gain margin", "gain", "dB"),
            ("disk margin", "disk", "1"),
        ):
            margin = getattr(margins, field)
            ends = ["", ""] if margin.interval is None else [f"{x:.4g}" for x in margin.interval]
            at = "" if margin.frequency is None else f"{margin.frequency:.3g}"
            by_linear = [] if linear is None else [_margin_text(getattr(linear, field))]
            rows.append([name, _margin_text(margin), *ends, unit, at, *by_linear])
        return [ReportTable([*head, *([] if linear is None else ["linear loop"])], rows)]

    @property
    def remarks(self) -> list[str]:
        """What to do where the amplitude of the feedback leaves doubts."""
        return [self.hint] if self.hint else []

    @cached_property
    def margins(self) -> Margins:
        """Gain, phase and disk margin with their intervals."""
        return margins(self.frequency, self.response, self.std)

    @property
    def hint(self) -> str:
        """What lowers the coherence and what it means; empty where it is high up to crossover."""
        crossover = self.margins.crossover.value
        inside = self.frequency <= 2.0 * (crossover or self.frequency[-1])
        if not inside.any() or float(self.coherence[inside].min()) >= _COHERENT:
            return ""
        at = int(np.argmin(np.where(inside, self.coherence, 2.0)))
        comparison = (
            ", beside which those of the linear loop stand" if self.linear is not None else ""
        )
        text = (
            f"coherence falls to {self.coherence[at]:.2f} at {self.frequency[at]:.3g} Hz: "
            "friction, backlash, relays or limits shape what was measured, and the margins are "
            f"those of a describing function at this amplitude{comparison}"
        )
        # A shaft that keeps turning never sticks.
        return f"{text}; a bias keeps the shaft turning" if self.loop == "speed" else text

    def plot(self) -> Figure:
        """Return a Bode plot: gain, phase, coherence over frequency."""
        return self.bode(f"{self.loop} loop")


def _named(every: Margins) -> dict[str, Margin]:
    return {
        "crossover [Hz]": every.crossover,
        "phase margin [deg]": every.phase,
        "gain margin [dB]": every.gain,
        "disk margin": every.disk,
    }


def loop_response(
    actuator: ActuatorLike,
    loop: str,
    low: float | str | None = None,
    high: float | str | None = None,
    amplitude: float | str | None = None,
    *,
    bias: float | str = 0.0,
    load: float | str = 0.0,
    realisations: int = 6,
    fidelity: str = "high",
    seed: int = 0,
    progress: Progress | None = None,
) -> LoopResponse:
    """Measure an open loop of a servo with its loops closed.

    Parameters
    ----------
    actuator : Actuator, str or path
        What is measured.
    loop : str
        ``position`` (speed and current loops closed inside), ``speed`` (no position loop) or
        ``current`` (neither; carrier drives only, relays have no linear loop).
    low, high : float or str, optional
        Frequency range, Hz; default 0.5, for the current 20, to 2000, or to what
        the solver's step resolves.
    amplitude : float or str, optional
        Greatest value of the injected command: output position, motor speed, torque of the motor.
    bias, load, realisations, fidelity, seed, progress
        As for `frequency_response`.

    Raises
    ------
    InputError
        No such loop in this actuator or drive, an empty range, a run that tripped or diverged.
    """
    loaded = _checked(as_actuator(actuator), loop, fidelity)
    unit, given = _excited(loaded, loop, amplitude)
    mode = "torque" if loop == "current" else loop
    excitation = Excitation(
        loaded, mode, unit, given, bias, load,
        realisations=realisations, fidelity=fidelity, seed=seed,
    )  # fmt: skip
    step = solver_step(loaded, fidelity)
    first, last = frequencies(
        _RANGE[loop][0] if low is None else low,
        min(_RANGE[loop][1], 0.999 / (_SAMPLES * step)) if high is None else high,
    )
    design = Multisine(first, last, step, lines=_LINES, falling=loop != "current")
    command, feedback, factor = _signals(loaded, loop)
    recordings = excitation.recordings(design, f"{command},{feedback}", progress)
    response, coherence, std = _ratio(design, recordings, (command, feedback, factor))
    linear = None
    if (straight := _without_nonlinear(loaded)) is not None:
        usual = replace(excitation, amplitude=_excited(loaded, loop, None)[1])
        larger = f"{_ABOVE_RELAYS * usual.size!r} {unit}"
        alike = replace(excitation, actuator=straight, amplitude=larger, realisations=1)
        straight_recordings = alike.recordings(design, f"{command},{feedback}", None)
        linear = margins(
            design.frequency, *_ratio(design, straight_recordings, (command, feedback, factor))[::2]
        )
    return LoopResponse(
        loop=loop, frequency=design.frequency, response=response, coherence=coherence, std=std,
        command=command, feedback=feedback, amplitude=excitation.size, realisations=realisations,
        feedback_amplitude=_size(recordings, feedback, factor), linear=linear,
    )  # fmt: skip


#: Dry friction and lost motion of a servo: what a linear loop has not.
_NONLINEAR = (
    "friction.static", "friction.dynamic", "load.friction", "screw.preload",
    "backlash.total", "backlash.extra", "gear.tooth_wear", "gear.tooth_chip",
)  # fmt: skip
#: Limits, and by what they are out of reach.
_LIMITS = ("control.speed_limit", "control.current_limit", "motor.torque_limit")
_OUT_OF_REACH = 100.0
#: The relays' band is a small part of so much more of the command.
_ABOVE_RELAYS = 5.0


def _without_nonlinear(actuator: Actuator) -> Actuator | None:
    """Return the actuator without dry friction and backlash; None where it has neither."""
    parameters = actuator.parameters
    away = {
        path: 0.0 for path in _NONLINEAR if path in parameters and parameters.value(path) != 0.0
    }
    if not away:
        return None
    wide = {path: _OUT_OF_REACH * parameters.value(path) for path in _LIMITS}
    return actuator.with_values(away | wide, source="linear loop", request=False)


def _size(recordings: list[Recording], feedback: str, factor: float) -> float:
    """Return the greatest value of the feedback about its mean."""
    values = [factor * np.asarray(item[feedback].values) for item in recordings]
    return max(float(np.max(np.abs(x - np.mean(x)))) for x in values)


def _checked(actuator: Actuator, loop: str, fidelity: str) -> Actuator:
    """Return the actuator whose loop is measured; refuse what has none."""
    from elevon.parameters.records import wirings

    check_fidelity(actuator.wiring, fidelity)
    if loop not in LOOPS:
        raise unknown("loop", loop, LOOPS, "--loop")
    if "position" not in wirings()[actuator.wiring]["modes"]:
        raise InputError(
            f"--loop: {actuator.name} has a control unit of its own; its loops take no command"
        )
    if loop == "current" and fidelity == "low":
        raise InputError("--loop current: the reduced-order model has a lag in its place; use high")
    if loop == "current" and actuator.parameters["drive.kind"].value != "pwm":
        raise InputError(
            f"--loop current: drive.kind = {actuator.parameters['drive.kind'].value} of "
            f"{actuator.name} has no linear current loop; set drive.kind=pwm"
        )
    if loop != "position" or actuator.parameters.value("control.speed_feedforward") == 0.0:
        return actuator
    # The feed-forward is outside the loop, but would reach the feedback past the error.
    return actuator.with_values({"control.speed_feedforward": 0.0}, source="loop measurement")


def _signals(actuator: Actuator, loop: str) -> tuple[str, str, float]:
    """Return what is compared: command, feedback and the feedback's factor."""
    if loop == "speed":
        return "speed_ref", "resolver_speed", 1.0
    if loop == "current":
        return "current_ref", "current_q", 1.0
    chosen = str(actuator.parameters["control.position_feedback"].value)
    if chosen != "resolver":
        return "command", f"{chosen}_position", 1.0
    value = actuator.parameters.value
    lead = value("screw.lead") if actuator.wiring == "ballscrew" else 1.0
    return "command", "resolver_position", lead / value("gear.ratio")


def _excited(
    actuator: Actuator, loop: str, amplitude: float | str | None
) -> tuple[str, float | str]:
    from elevon.scenario.compile import signal_units

    place = signal_units(actuator.wiring, "high")["output_position"]
    unit = {"position": place, "speed": "rad/s", "current": "N m"}[loop]
    return unit, _SIZE[loop][place == "m"] if amplitude is None else amplitude


def _ratio(
    design: Multisine, recordings: list[Recording], signals: tuple[str, str, float]
) -> tuple[Complex, Floats, Floats]:
    """Return the loop, its coherence and its deviation over realisations."""
    command, feedback, factor = signals
    injected, back = (
        np.concatenate([design.spectrum(item, name) for item in recordings])
        for name in (command, feedback)
    )
    back = factor * back
    error = injected - back
    through = np.sum(error * injected.conj(), axis=0)
    loop = np.sum(back * injected.conj(), axis=0) / through
    power = np.sum(np.abs(injected) ** 2, axis=0)
    cross = np.abs(np.sum(back * injected.conj(), axis=0)) ** 2
    coherence = np.minimum(cross / (power * np.sum(np.abs(back) ** 2, axis=0)), 1.0)
    count = len(injected)
    if count == 1:
        return loop, coherence, np.full(len(loop), np.nan)
    unexplained = np.sum(np.abs(back - loop * error) ** 2, axis=0) / (count - 1)
    std = np.sqrt(0.5 * unexplained * power) / np.abs(through) / np.abs(loop)
    return loop, coherence, np.asarray(std, dtype=np.float64)
