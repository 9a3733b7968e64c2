"""A Gymnasium environment over a live session, for controllers that learn (extra ``gym``)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import gymnasium
import numpy as np

from elevon.arrays import Floats
from elevon.errors import DivergedError, InputError
from elevon.session import Session, SessionState
from elevon.simulate.prepare import ActuatorLike
from elevon.units import parse_quantity


class ActuatorEnv(gymnasium.Env[Floats, Floats]):
    """An actuator that follows a target, one action a period.

    Parameters
    ----------
    actuator : Actuator, str or path
        What moves.
    limit : float or str
        Largest action, in the unit of `mode`; actions are between -1 and 1 of it.
    target : callable
        Time in s to the wanted value of the first observed signal, SI.
    mode : str
        What an action is: ``torque``, ``speed`` or ``position``.
    observed : sequence of str
        Signals of an observation, SI; the target stands behind them.
    period : float or str
        Of the actions.
    duration : float or str
        Of an episode.
    reward : callable, optional
        Of the observation and the action; by default minus the squared error, less a thousandth of
        the squared action.
    fidelity : str
        ``low`` by default: fast enough to learn on.
    """

    def __init__(
        self,
        actuator: ActuatorLike,
        limit: float | str,
        target: Callable[[float], float],
        *,
        mode: str = "torque",
        observed: Sequence[str] = ("output_position", "motor_speed"),
        period: float | str = "5 ms",
        duration: float | str = "1 s",
        reward: Callable[[Floats, Floats], float] | None = None,
        fidelity: str = "low",
    ) -> None:
        self.session = Session(actuator, mode=mode, fidelity=fidelity, signals=observed)
        self._start: SessionState = self.session.save()
        self._limit = parse_quantity(limit, self.session.unit("command") or "1", "limit")
        if not self._limit > 0.0:
            raise InputError(f"limit = {limit} must be positive")
        self._target, self._observed = target, tuple(observed)
        self._period = parse_quantity(period, "s", "period")
        self._duration = parse_quantity(duration, "s", "duration")
        self._reward = reward or _squared
        size = len(self._observed) + 1
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, object] | None = None
    ) -> tuple[Floats, dict[str, object]]:
        """Go back to the start of an episode."""
        super().reset(seed=seed, options=options)
        self.session.restore(self._start)
        return self._seen(), {}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, object]]:
        """Act for one period; an episode is terminated where the drive trips or diverges."""
        share = np.clip(np.asarray(action, dtype=np.float64).reshape(1), -1.0, 1.0)
        self.session.set(command=float(share[0]) * self._limit)
        # The status below ends the episode.
        with suppress(DivergedError):
            self.session.advance(self._period)
        seen = self._seen()
        status, message = self.session.state_of(0)
        ended = self.session.time > self._duration - 0.5 * self._period
        info = {"time": self.session.time, "status": status, "message": message}
        return seen, self._reward(seen, share), status != "ok", ended, info

    def _seen(self) -> Floats:
        read = self.session.read(*self._observed)
        return np.array([*read.values(), self._target(self.session.time)])


def _squared(seen: Floats, action: Floats) -> float:
    return -float((seen[0] - seen[-1]) ** 2 + 1e-3 * action[0] ** 2)
