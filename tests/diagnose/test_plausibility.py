"""What no candidate is looked for by: it makes an alarm of its own, and refutes causes."""

from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator
from elevon.diagnose.by_model import diagnose
from elevon.diagnose.engine.likelihood import Hypothesis
from elevon.diagnose.engine.plausibility import Plausibility, weigh_plausibility
from elevon.diagnose.engine.posterior import Posterior
from tests.diagnose.virtual import bench_logs

FEW = ["backlash@transmission", "friction@transmission"]


def _seen(log, role, values):
    """The log with another channel, which is then all there is of it."""
    return replace(log.with_channels(**{role: values}), recording=None)


@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
def test_what_no_candidate_is_looked_for_by_makes_an_unknown_fault():
    """A late encoder looks like backlash by its width; noise of the voltage like nothing at all."""
    unit = Actuator.load("torino-rotary")
    base, day = bench_logs(unit, [(1, []), (2, [])])
    late = np.interp(day.time - 0.01, day.time, day.output)
    rough = day["torque_voltage"] + np.random.default_rng(3).normal(0.0, 2.0, len(day.time))
    logs = [day, _seen(day, "output_position", late), _seen(day, "torque_voltage", rough)]
    answers = [diagnose([log], unit, baselines=[base], faults=FEW) for log in logs]
    assert [a.status for a in answers] == ["healthy", "unknown_fault", "unknown_fault"]
    assert answers[1].reason.feature == "position_lag"
    assert answers[2].reason.feature in ("voltage_noise", "voltage_rest")
    assert all(a.p_other > 0.5 for a in answers[1:])
    moved = {m.name: m for m in answers[1].features}
    assert moved["position_lag"].value == pytest.approx(0.01, rel=0.2)


def test_noise_that_a_candidate_amplifies_does_not_refute_it():
    after = _probabilities((0.49, 0.49), allowed=(8.0, 0.0), by_run=(0.0, 0.0))
    assert after.of("a") > 0.9
    assert _probabilities((0.49, 0.49), allowed=(0.0, 0.0), by_run=(0.0, 0.0)).other > 0.9


def test_what_a_model_run_shows_speaks_for_a_cause_and_a_wide_allowance_for_none():
    assert _probabilities((0.8, 0.18), allowed=(0.0, 8.0), by_run=(0.0, 8.0)).of("b") > 0.7
    assert _probabilities((0.8, 0.18), allowed=(0.0, 8.0), by_run=(0.0, 0.0)).other > 0.9


def _probabilities(before, *, allowed, by_run):
    """Weigh two causes by a noise that is eight deviations off."""
    plausible = Plausibility(("target_noise",), ("A",), *(np.array([x]) for x in (0.28, 0.2, 0.01)))
    one, two = (Hypothesis((k,), 0.0, 0.5, best=(0.4,)) for k in ("a", "b"))
    before = Posterior((one, two), before, 0.02)
    rows = [np.array(x)[:, None] for x in (allowed, by_run)]
    return weigh_plausibility(before, plausible.score, plausible.degrees, *rows)
