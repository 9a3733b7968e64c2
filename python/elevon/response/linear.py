"""Linear models of the reduced-order model about an operating point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
import numpy.typing as npt

from elevon.arrays import Complex, Floats
from elevon.errors import InputError
from elevon.plain import STORED, in_unit, key
from elevon.results import Result
from elevon.session import Session
from elevon.simulate.prepare import ActuatorLike
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from scipy.signal import StateSpace


@dataclass(frozen=True, kw_only=True)
class BodeLines(Result):
    """A response at each line.

    Attributes
    ----------
    frequency : ndarray, shape (n,)
        Hz.
    response : ndarray of complex, shape (n,)
        Output over input, or feedback over error.
    coherence : ndarray, shape (n,)
        Share of the output's power that is linear in the input, 0 to 1: noise and nonlinearity
        (backlash, friction, limits) take the rest.
    std : ndarray, shape (n,)
        Relative standard deviation of the gain, and of the phase in rad; NaN of one realisation.
    amplitude : float
        Greatest value of the input about its mean, SI.
    realisations : int
        Independent inputs the figures stand on.
    actuator : str
        Its name.
    """

    frequency: Annotated[Floats, key("frequency_hz"), in_unit("Hz")]
    response: Annotated[Complex, STORED]
    coherence: Floats
    std: Annotated[Floats, key("gain_relative_std")]
    amplitude: float
    realisations: int
    actuator: str = ""

    status: ClassVar = "ok"

    @property
    def gain(self) -> Floats:
        """Gain, shape (n,)."""
        return np.abs(self.response)

    @property
    def phase(self) -> Floats:
        """Phase in rad, unwrapped from the lowest frequency on, shape (n,)."""
        return np.unwrap(np.angle(self.response))

    @property
    def gain_db(self) -> Floats:
        """Gain in decibels, shape (n,)."""
        return np.asarray(20.0 * np.log10(self.gain))

    @property
    def phase_deg(self) -> Floats:
        """Phase in degrees, unwrapped, shape (n,)."""
        return np.asarray(np.rad2deg(self.phase))

    def bode(self, title: str, unit: str = "1") -> Figure:
        """Return gain, phase and coherence over frequency, with intervals of 90 %.

        Parameters
        ----------
        title, unit : str
            Of the plot and of the gain.
        """
        from elevon.report.figures import new_figure

        with new_figure(3, 1, height=7.0, sharex=True, height_ratios=[2, 2, 1]) as (figure, axes):
            spread = 20.0 / np.log(10.0) * 1.645 * np.nan_to_num(self.std)
            turned = np.rad2deg(1.645 * np.nan_to_num(self.std))
            lines = (self.gain_db, spread), (self.phase_deg, turned)
            for axis, (line, width) in zip(axes[:2], lines, strict=True):
                axis.fill_between(self.frequency, line - width, line + width, alpha=0.25, lw=0)
                axis.semilogx(self.frequency, line, marker=".", ms=4)
            axes[2].semilogx(self.frequency, self.coherence, marker=".", ms=4)
            axes[0].set_title(title)
            axes[0].set_ylabel(f"gain [dB of 1 {unit}]" if unit != "1" else "gain [dB]")
            axes[1].set_ylabel("phase [deg]")
            axes[2].set(ylabel="coherence", xlabel="frequency [Hz]", ylim=(0.0, 1.05))
        return figure


def zero_between(frequency: Floats, values: Floats, at: int) -> float:
    """Return where values between two lines are zero [Hz], interpolated over log frequency."""
    low, high = np.log(frequency[at : at + 2])
    share = values[at] / (values[at] - values[at + 1])
    return float(np.exp(low + share * (high - low)))


_SMALLEST = 1e-4  # of the largest singular value: below it stands what is not linear


@dataclass(frozen=True)
class LinearModel(Result):
    """``x[k+1] = a x[k] + b u[k]``, ``y[k] = c x[k] + d u[k]``, deviations from an operating point.

    The state is balanced: it has no physical names, and no part that input or output do not see.

    Attributes
    ----------
    a, b, c, d : ndarray, shapes (n, n), (n, inputs), (outputs, n), (outputs, inputs)
        SI.
    period : float
        s.
    inputs, outputs : tuple of str
        Ports and signals.
    point : mapping
        Outputs at the operating point, SI.
    singular_values : ndarray
        Of the Hankel matrix of impulse responses, relative to the largest.
    error : float
        Rms difference of the model's impulse responses from those simulated, relative to these.
    nonlinearity : float
        The same between the responses to the pulse and to one of half its height: what the linear
        model cannot hold at this operating point.
    """

    a: Floats
    b: Floats
    c: Floats
    d: Floats
    period: Annotated[float, key("period_s"), in_unit("s")]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    point: Mapping[str, float]
    singular_values: Annotated[Floats, STORED]
    error: float
    nonlinearity: float

    KIND: ClassVar = "linear-model"
    COMPUTED: ClassVar = ("poles=pole_parts",)
    TABLE: ClassVar = "pole_parts"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        return f"{', '.join(self.inputs)} to {', '.join(self.outputs)}: {self.order} states."

    @property
    def pole_parts(self) -> list[dict[str, float]]:
        """Real and imaginary part of each pole, 1/s."""
        return [{"real": x.real, "imaginary": x.imag} for x in self.poles]

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.a)

    @property
    def poles(self) -> Complex:
        """Poles of the continuous model that a zero-order hold turns into this one, 1/s."""
        return np.asarray(np.log(np.linalg.eigvals(self.a).astype(complex)) / self.period)

    def response(self, frequency: npt.ArrayLike) -> Complex:
        """Return the frequency response, shape (n, outputs, inputs), at frequencies in Hz."""
        z = np.exp(2j * np.pi * np.atleast_1d(np.asarray(frequency, dtype=float)) * self.period)
        eye = np.eye(self.order)
        return np.array([self.c @ np.linalg.solve(x * eye - self.a, self.b) + self.d for x in z])

    def to_scipy(self) -> StateSpace:
        """Return it as a discrete `scipy.signal.StateSpace`."""
        from scipy.signal import StateSpace

        return StateSpace(self.a, self.b, self.c, self.d, dt=self.period)


def linearise(
    actuator: ActuatorLike,
    *,
    inputs: Sequence[str] = ("command",),
    outputs: Sequence[str] = ("output_position",),
    mode: str = "position",
    command: float | str = 0.0,
    load: float | str = 0.0,
    settle: float | str = "1 s",
    period: float | str = "1 ms",
    horizon: float | str = "0.5 s",
    pulse: float = 1e-6,
    order: int | None = None,
) -> LinearModel:
    """Linearise the reduced-order model about an operating point.

    The session is brought to the point and its state saved; from there each input gives a pulse of
    one period, up and down. Half the difference of the answers is the impulse response, and its
    Hankel matrix gives the balanced model (eigensystem realization: J.-N. Juang, R. S. Pappa,
    Journal of Guidance 8(5), 1985).

    Parameters
    ----------
    actuator : Actuator, str or path
        What is linearised.
    inputs, outputs : sequence of str
        Ports of `Session.set` and signals.
    mode : str
        ``position``, ``speed`` or ``torque``.
    command, load : float or str
        Of the operating point: held from the start. A shaft at rest is held by its friction, and a
        linear model of it says nothing; a speed has none to change sign.
    settle : float or str
        Time until the point is reached.
    period, horizon : float or str
        Sampling of the model, and length of the impulse responses. Inputs are held over a period:
        a sine of the same samples, whose slope the derivative answers, acts up to a period sooner.
    pulse : float
        Height in the input's SI unit: small enough that no limit is met.
    order : int, optional
        States; by default all whose singular value stands above 1e-4 of the largest.

    Raises
    ------
    InputError
        No such port or signal, nothing that answers, a horizon of fewer than four periods.
    """
    step = parse_quantity(period, "s", "period")
    count = round(parse_quantity(horizon, "s", "horizon") / step)
    if count < 4:
        raise InputError(f"horizon = {horizon} is shorter than four periods ({step:g} s)")
    session = Session(actuator, mode=mode, fidelity="low", signals=outputs)
    at = _settled(session, command, load, settle)
    markov, half = (
        np.stack([_impulse(session, name, at, outputs, (step, count, h)) for name in inputs], 2)
        for h in (pulse, 0.5 * pulse)
    )
    if not np.any(markov[1:]):
        raise InputError(
            "nothing answers the pulses: friction holds the shaft at this operating point; give it "
            "a speed (mode='speed', command=...), or a larger pulse"
        )
    a, b, c, values = _realised(markov, order)
    return LinearModel(
        a, b, c, markov[0], step, tuple(inputs), tuple(outputs), session.read(*outputs), values,
        error=_error(markov, a, b, c),
        nonlinearity=float(np.sqrt(np.sum((half - markov) ** 2) / np.sum(markov**2))),
    )  # fmt: skip


def _settled(
    session: Session, command: float | str, load: float | str, settle: float | str
) -> dict[str, float]:
    """Bring a session to its operating point; return the inputs there."""
    at = {"command": parse_quantity(command, session.unit("command") or "1", "command")}
    if load:
        at["output"] = parse_quantity(load, session.unit("output"), "load")
    session.set(**at)
    session.advance(round(parse_quantity(settle, "s", "settle") / session.step) * session.step)
    return at


def _impulse(
    session: Session,
    name: str,
    at: Mapping[str, float],
    outputs: Sequence[str],
    sampling: tuple[float, int, float],
) -> Floats:
    """Return the response of the outputs to a unit pulse of one period, shape (count, outputs)."""
    step, count, pulse = sampling
    state = session.save()
    level = at.get(name, 0.0)
    answers = []
    for sign in (1.0, -1.0):
        rows = []
        for k in range(count):
            session.set(**{name: level + (sign * pulse if k == 0 else 0.0)})
            rows.append(list(session.read(*outputs).values()))
            session.advance(step)
        answers.append(np.array(rows))
        session.restore(state)
    return np.asarray((answers[0] - answers[1]) / (2.0 * pulse))


def _realised(markov: Floats, order: int | None) -> tuple[Floats, Floats, Floats, Floats]:
    """Return a, b, c and the relative singular values from ``markov[k]``, shape (k, p, m)."""
    count, p, m = markov.shape
    rows = (count - 1) // 2
    blocks = [[markov[1 + i + j] for j in range(rows)] for i in range(rows)]
    later = [[markov[2 + i + j] for j in range(rows)] for i in range(rows)]
    left, values, right = np.linalg.svd(np.block(blocks), full_matrices=False)
    relative = values / values[0]
    n = int(np.sum(relative > _SMALLEST)) if order is None else order
    root = np.sqrt(values[:n])
    a = (left[:, :n] / root).T @ np.block(later) @ (right[:n].T / root)
    return a, root[:, None] * right[:n, :m], left[:p, :n] * root, relative


def _error(markov: Floats, a: Floats, b: Floats, c: Floats) -> float:
    x, squares = b, 0.0
    for answer in markov[1:]:
        squares += float(np.sum((c @ x - answer) ** 2))
        x = a @ x
    return float(np.sqrt(squares / np.sum(markov[1:] ** 2)))
