"""Population searches: a genetic algorithm, differential evolution, swarm, and grey wolves.

The first three are pymoo's with its own settings. No well-kept library has the grey wolves; they
are Mirjalili, Mirjalili and Lewis (2014), equations (3.1) to (3.7).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError, unknown

__all__ = ["METHODS", "POPULATION", "Best", "search"]

Costs = Callable[[Floats], Floats]
POPULATION = 40
METHODS = ("genetic", "differential-evolution", "particle-swarm", "grey-wolf")


@dataclass(frozen=True)
class Best:
    """Where a search ended.

    Attributes
    ----------
    vector : ndarray, shape (n,)
        In [0, 1].
    cost : float
        There.
    """

    vector: Floats
    cost: float


def search(method: str, costs: Costs, size: int, *, budget: int, seed: int) -> Best:
    """Make a cost small within a budget of evaluations.

    Parameters
    ----------
    method : str
        Of `METHODS`.
    costs : callable
        Vectors, shape (n, size), in [0, 1] to costs, shape (n,).
    size : int
        Length of a vector.
    budget : int
        Evaluations; whole populations are run.
    seed : int
        Of the search.

    Raises
    ------
    UnknownNameError
        No such method.
    InputError
        pymoo is not installed.
    """
    if method not in METHODS:
        raise unknown("method", method, METHODS, "search")
    if method == "grey-wolf":
        return _wolves(costs, size, budget, np.random.default_rng(seed))
    return _pymoo(method, costs, size, budget, seed)


def _pymoo(method: str, costs: Costs, size: int, budget: int, seed: int) -> Best:
    try:
        from pymoo.algorithms.soo.nonconvex.de import DE
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.algorithms.soo.nonconvex.pso import PSO
        from pymoo.core.problem import Problem
        from pymoo.optimize import minimize
    except ImportError as error:
        raise InputError("the population searches need pymoo: pip install elevon[optimise]") from (
            error
        )

    class Misfit(Problem):  # type: ignore[misc]
        """The cost in pymoo's form."""

        def _evaluate(self, x: Floats, out: dict[str, Any], *_a: Any, **_k: Any) -> None:
            out["F"] = costs(x)[:, None]

    kinds = {"genetic": GA, "differential-evolution": DE, "particle-swarm": PSO}
    result = minimize(
        Misfit(n_var=size, n_obj=1, xl=np.zeros(size), xu=np.ones(size)),
        kinds[method](pop_size=POPULATION),
        ("n_eval", budget),
        seed=seed,
        verbose=False,
    )
    return Best(np.asarray(result.X, dtype=np.float64), float(np.ravel(result.F)[0]))


def _wolves(costs: Costs, size: int, budget: int, rng: np.random.Generator) -> Best:
    """All follow the three best, ever more closely: a falls from 2 to 0."""
    place = rng.random((POPULATION, size))
    leaders, values = np.zeros((0, size)), np.zeros(0)
    rounds = max(budget // POPULATION, 1)
    for step in range(rounds):
        leaders = np.vstack((leaders, place))
        values = np.concatenate((values, costs(place)))
        first = np.argsort(values, kind="stable")[:3]
        leaders, values = leaders[first], values[first]
        a = 2.0 * (1.0 - step / rounds)
        goals = np.zeros_like(place)
        for leader in leaders:
            reach = a * (2.0 * rng.random(place.shape) - 1.0)
            distance = np.abs(2.0 * rng.random(place.shape) * leader - place)
            goals += (leader - reach * distance) / len(leaders)
        place = np.clip(goals, 0.0, 1.0)
    return Best(leaders[0], float(values[0]))
