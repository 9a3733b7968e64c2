"""What holds for every actuator, whatever its logs are read by."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from elevon.diagnose.by_model import diagnose, reading_of
from elevon.diagnose.engine.candidates import chosen
from elevon.diagnose.engine.case import case_of, chance_of
from elevon.errors import InputError
from studies.fault_limits.standard import Day, day_logs, standard_tests
from tests.contract import shipped
from tests.contract.test_diagnosis import TESTED, halved

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
FEW = {
    "rotary": ["backlash@transmission", "friction@transmission"],
    "ballscrew": ["backlash@transmission", "gain_drift@control.position"],
    "landing_gear": ["sag@supply", "short@motor.phase_a"],
}


CHEAPEST = "torino-rotary"
EXAMPLE = str(Path(__file__).parents[2] / "examples" / "linear-drive" / "drive.toml")


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(n, marks=[] if n == CHEAPEST else pytest.mark.long) for n in [*TESTED, EXAMPLE]
    ],
)
def case(request):
    """An actuator, few candidates, and three healthy days of half of its first test."""
    actuator = shipped.actuator(request.param)
    test = halved(standard_tests(actuator)[0])
    logs = day_logs(actuator, test, [Day((), 281), Day((), 282), Day((), 283)])
    named = [replace(log, name=f"day {k}") for k, log in enumerate(logs)]
    return actuator, FEW[actuator.wiring], named


def plain(answer):
    """An answer without what may depend on the hour."""
    return {k: v for k, v in answer.to_dict().items() if k != "seconds"}


def test_a_log_as_its_own_baseline_is_healthy(case):
    actuator, few, logs = case
    answer = diagnose(logs[:1], actuator, baselines=[replace(logs[0], name="b")], faults=few)
    assert answer.status == "healthy"
    assert max(abs(item.score) for item in answer.features) < 1.0


@pytest.mark.long
def test_the_order_of_baselines_changes_nothing(case):
    actuator, few, logs = case
    first = diagnose(logs[:1], actuator, baselines=logs[1:], faults=few)
    other = diagnose(logs[:1], actuator, baselines=logs[:0:-1], faults=few)
    assert plain(first) == plain(other)


@pytest.mark.long
def test_the_order_of_logs_changes_nothing(case):
    actuator, few, logs = case
    first = diagnose(logs[:2], actuator, baselines=logs[2:], faults=few)
    other = diagnose(logs[1::-1], actuator, baselines=logs[2:], faults=few)
    assert first.status == other.status
    assert first.best == other.best
    assert first.p_fault == pytest.approx(other.p_fault, rel=1e-6)


def test_a_second_baseline_of_the_same_day_narrows_nothing(case):
    """What is as likely of a healthy log beside one is as likely beside both."""
    actuator, few, logs = case
    candidates = chosen(few, actuator)
    item, *days = (reading_of(log, actuator) for log in (logs[0], logs[1], logs[1]))
    once, twice = (case_of(item, candidates, days[:n]) for n in (1, 2))
    width, both = (np.diag(c.covariance) for c in (once, twice))
    assert np.all(both >= 0.999 * width)
    assert chance_of(twice, candidates) >= 0.9 * chance_of(once, candidates)


@pytest.mark.long
def test_the_same_day_again_as_a_second_baseline_is_no_alarm(case):
    actuator, few, logs = case
    days = [replace(logs[1], name=f"b{k}") for k in range(2)]
    once, twice = (diagnose(logs[:1], actuator, baselines=days[:n], faults=few) for n in (1, 2))
    assert (once.status, twice.status) == ("healthy", "healthy")


def current(log):
    """The role of a log that is a current."""
    return next(r for r in ("torque_current", "supply_current") if log.has(r))


def changed(log, role, values):
    return replace(log, channels={**log.channels, role: values})


def test_currents_a_thousand_times_too_large_are_refused(case):
    actuator, few, logs = case
    role = current(logs[0])
    with pytest.raises(InputError, match=f"{role} reaches .* A can flow"):
        diagnose([changed(logs[0], role, 1e3 * logs[0][role])], actuator, faults=few)


def test_swapped_positions_are_refused(case):
    actuator, few, logs = case
    log = logs[0]
    if not log.has("motor_position", "output_position"):
        pytest.skip("its logs have one position")
    swapped = changed(log, "motor_position", log["output_position"])
    swapped = changed(swapped, "output_position", log["motor_position"])
    with pytest.raises(InputError, match="the motor turns"):
        diagnose([swapped], actuator, faults=few)


def test_a_swapped_speed_and_current_are_refused(case):
    actuator, few, logs = case
    log, role = logs[0], current(logs[0])
    size = 0.01 * float(np.ptp(log["motor_speed"]))  # as small as a current may be
    swapped = changed(log, "motor_speed", log[role] * size)
    swapped = changed(swapped, role, log["motor_speed"] * 0.01)
    with pytest.raises(InputError, match=f"changes as {role} goes, not as motor_speed"):
        diagnose([swapped], actuator, faults=few)


def test_a_clipped_current_and_missing_positions_are_the_first_findings(case):
    actuator, few, logs = case
    log, role = logs[0], current(logs[0])
    size = float(np.quantile(np.abs(log[role]), 0.7))
    clipped = changed(log, role, np.clip(log[role], -size, size))
    holes = log["output_position"].copy()
    holes[::5] = np.nan
    answer = diagnose([changed(clipped, "output_position", holes)], actuator, faults=few)
    early = answer.findings[:2]
    assert any(f"of {role} sit at" in text for text in early)
    assert any("20 % of output_position are missing" in text for text in early)
