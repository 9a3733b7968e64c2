"""One suite over every shipped actuator and fidelity."""

from __future__ import annotations

import numpy as np
import pytest

import elevon
from elevon import _core
from tests.contract import shipped

ACTUATORS = shipped.names()
FIDELITIES = [(name, fidelity) for name in ACTUATORS for fidelity in shipped.fidelities(name)]


def test_the_rotary_actuator_is_among_them() -> None:
    """An empty parametrisation would pass in silence."""
    assert "torino-rotary" in ACTUATORS


@pytest.mark.parametrize("name", shipped.shipped())
def test_every_shipped_set_loads(name: str) -> None:
    """A set that the core has no wiring for is not ready to ship."""
    assert elevon.Actuator.load(name).name == name


@pytest.mark.parametrize("name", shipped.shipped())
def test_every_value_has_a_unit_a_source_and_lies_in_range(name: str) -> None:
    """ASSUMED is a legal source, silence is not, and an assumption gives its reason."""
    actuator = elevon.Actuator.load(name)
    records = {record["path"]: record for record in _core.parameters(actuator.wiring)}
    for path, parameter in actuator.parameters.items():
        assert path in records
        assert parameter.source, path
        assert parameter.unit is not None, path
        if parameter.source.startswith("ASSUMED"):
            reason = parameter.source.removeprefix("ASSUMED").strip(" :") + parameter.note
            assert len(reason) > 10, path
        if records[path]["choices"] is None:
            assert records[path]["minimum"] <= parameter.value <= records[path]["maximum"], path


@pytest.mark.parametrize(("name", "fidelity"), FIDELITIES)
def test_every_signal_can_be_recorded_and_is_finite(name: str, fidelity: str) -> None:
    """On one clock, each sample a number."""
    chosen = shipped.signals(name, fidelity)
    rec = elevon.simulate(
        elevon.Actuator.load(name),
        shipped.scenario(name),
        fidelity=fidelity,
        record=[",".join(chosen) + "@1 kHz"],
    )
    assert rec.meta["status"] == "ok"
    for signal in chosen:
        assert np.all(np.isfinite(rec[signal].values)), signal
    time = rec[chosen[0]].time
    assert np.all(np.diff(time) > 0)


@pytest.mark.parametrize(("name", "fidelity"), FIDELITIES)
def test_an_actuator_left_alone_stays_at_rest(name: str, fidelity: str) -> None:
    """No command, no load: no motion. A drive that creeps by itself has a sign wrong."""
    rec = elevon.simulate(
        elevon.Actuator.load(name),
        shipped.standstill(name),
        fidelity=fidelity,
        record=["motor_speed,motor_position@1 kHz"],
    )
    assert np.ptp(rec["motor_position"].values) < 1e-3


@pytest.mark.parametrize(("name", "fidelity"), FIDELITIES)
def test_positive_command_moves_everything_positive(name: str, fidelity: str) -> None:
    """The convention of signs: speed command up -> motor up -> output up."""
    rec = elevon.simulate(
        elevon.Actuator.load(name),
        shipped.forward(name),
        fidelity=fidelity,
        record=["motor_speed,motor_position,output_position@1 kHz"],
    )
    for signal in ("motor_speed", "motor_position", "output_position"):
        assert rec.final[signal] > rec[signal].values[0], signal


@pytest.mark.parametrize("name", ACTUATORS)
def test_a_batch_equals_its_single_runs(name: str) -> None:
    """Three seeds of every fidelity, bit for bit."""
    actuator = elevon.Actuator.load(name)
    for fidelity in shipped.fidelities(name):
        record = [",".join(shipped.signals(name, fidelity)) + "@1 kHz"]
        runs = [elevon.Run(actuator, shipped.scenario(name), seed, str(seed)) for seed in range(3)]
        together = elevon.simulate_batch(runs, fidelity=fidelity, record=record)
        for run, many in zip(runs, together, strict=True):
            one = elevon.simulate(
                actuator, run.scenario, fidelity=fidelity, record=record, seed=run.seed
            )
            for signal in shipped.signals(name, fidelity):
                assert np.array_equal(one[signal].values, many[signal].values, equal_nan=True), (
                    fidelity,
                    signal,
                )
