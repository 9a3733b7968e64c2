"""One run, prepared once and simulated many times with other values: for optimisers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.faults import Fault
from elevon.parameters.records import Record as ParameterRecord
from elevon.parameters.records import positions, record_of
from elevon.simulate.acting import report
from elevon.simulate.batch import run_core
from elevon.simulate.prepare import (
    ActuatorLike,
    Features,
    Prepared,
    Record,
    Run,
    ScenarioLike,
    changed,
)
from elevon.simulate.prepare import prepare as prepare_run

#: They decide how a run is recorded, and that is settled once.
_SETTLED = ("solver.step", "low.step")


@dataclass(frozen=True)
class PreparedResult:
    """What a prepared run gives: arrays, without a recording around them.

    Attributes
    ----------
    status : str
        ``ok``, ``tripped`` or ``diverged``.
    message : str
        Why it is not ``ok``.
    time : mapping of str to ndarray
        Clock to its instants, shape (n,), s.
    values : mapping of str to ndarray
        Signal to its samples, shape (n,), SI, on the clock that records it.
    final : mapping of str to float
        Last value of each signal, SI.
    features : mapping of str to float
        Those that were requested, SI; NaN where the motion gives none.
    """

    status: str
    message: str
    time: Mapping[str, Floats]
    values: Mapping[str, Floats]
    final: Mapping[str, float]
    features: Mapping[str, float]


class PreparedRun:
    """A run whose names, units and records are settled; `prepare` makes it.

    Calling it with values in SI simulates it. It may be called from several threads.
    """

    def __init__(self, prepared: Prepared, fidelity: str, vary: Sequence[str]) -> None:
        wiring = prepared.actuator.wiring
        self._prepared, self._fidelity = prepared, fidelity
        self._vary = tuple(vary)
        self._records = [_number(wiring, path) for path in self._vary]
        self._places = [positions(wiring)[path] for path in self._vary]

    @property
    def vary(self) -> tuple[str, ...]:
        """Return the paths of the values, in their order."""
        return self._vary

    @property
    def values(self) -> Floats:
        """Return the values that it was prepared with, shape (len(vary),), SI."""
        return np.array(self._prepared.core["parameters"][self._places])

    def __call__(self, values: Sequence[float] | Floats = (), *, seed: int = 0) -> PreparedResult:
        """Simulate with other values.

        Parameters
        ----------
        values : sequence of float, shape (len(vary),)
            In the order of `vary`, SI.
        seed : int
            Of the random numbers.

        Returns
        -------
        PreparedResult
            Arrays in SI; equal to the last bit to those of `simulate` with the same values.

        Raises
        ------
        InputError
            Another number of values; a value outside its range; values that cannot be together:
            path, value and limit are named.
        """
        item = replace(
            self._prepared,
            core={**self._prepared.core, "parameters": self._vector(values), "seed": seed},
        )
        result = run_core([item], self._fidelity, 1, "auto", _going_on)[0]
        series: dict[str, Floats] = {}
        time: dict[str, Floats] = {}
        for plan in item.plan:
            rows = result["clocks"][plan.name]
            time[plan.name] = rows["time"]
            columns = rows["values"].T
            series.update(zip(plan.signals, columns, strict=False))
        features = {n: x for plan in item.features for n, x in plan.values(result).items()}
        return PreparedResult(
            result["status"], result["message"], time, series, result["final"], features
        )

    def _vector(self, values: Sequence[float] | Floats) -> Floats:
        from elevon import _core

        if len(values) != len(self._vary):
            raise InputError(f"values: {len(values)} given for {len(self._vary)} of `vary`")
        vector = np.array(self._prepared.core["parameters"])
        for path, record, place, value in zip(
            self._vary, self._records, self._places, values, strict=True
        ):
            record.check(float(value), path)
            vector[place] = value
        findings = _core.check(self._prepared.actuator.wiring, self._fidelity, vector)
        wrong = [str(f["message"]) for f in findings if f.get("severity", "error") == "error"]
        if wrong:
            raise InputError("\n".join(wrong))
        return vector


def _going_on(_: float) -> bool:
    return True


def _number(wiring: str, path: str) -> ParameterRecord:
    record = record_of(wiring, path, "vary")
    if record.choices is not None:
        raise InputError(f"vary: {path} is a choice; only numbers vary in a prepared run")
    if path in _SETTLED:
        raise InputError(f"vary: {path} decides what is recorded and is settled once; prepare anew")
    return record


def prepare(
    actuator: ActuatorLike,
    scenario: ScenarioLike = None,
    *,
    record: Record = None,
    fidelity: str = "high",
    faults: Sequence[Fault | str] = (),
    features: Features = None,
    vary: Sequence[str] = (),
) -> PreparedRun:
    """Prepare a run that is simulated many times with other values.

    Parameters
    ----------
    actuator : Actuator, str or path
        What moves; a name or a path is loaded.
    scenario : Scenario, mapping, path or None
        As for `simulate`.
    record : str or sequence of str, optional
        What is kept, as for `simulate`.
    fidelity : str
        ``high`` or ``low``.
    faults : sequence of Fault or str
        Beside the scenario's own.
    features : str or sequence of str, optional
        As for `simulate`.
    vary : sequence of str
        Paths of the parameters whose values each call gives: numbers, not choices or steps.

    Returns
    -------
    PreparedRun
        Called with values in SI, it simulates.

    Raises
    ------
    InputError
        Anything that `simulate` refuses; a path twice, unknown, a choice, or a solver step.

    Examples
    --------
    >>> run = elevon.prepare(
    ...     "torino-rotary", vary=["friction.viscous"], fidelity="low"
    ... )  # doctest: +SKIP
    >>> run([4e-3]).final["output_position"]  # doctest: +SKIP
    """
    if isinstance(vary, str):
        raise InputError(f"vary: {vary!r} is one path; expected a list: [{vary!r}]")
    if len(set(vary)) != len(vary):
        raise InputError(f"vary: a path is given twice: {', '.join(vary)}")
    run = Run(actuator, scenario)
    if faults:
        run = Run(run.actuator, changed(run.scenario, None, faults))
    prepared = prepare_run(run, fidelity, record, features)
    report([prepared.notices], strict=False)
    return PreparedRun(prepared, fidelity, vary)
