"""Severities by sums over grids against a sampler on the same density, on logs of the bench."""

import numpy as np
import pytest

from elevon import Actuator
from elevon.diagnose.engine.candidates import CANDIDATES
from elevon.diagnose.engine.case import case_of
from elevon.diagnose.engine.likelihood import Frame, one_fault, prior_density, two_faults
from elevon.diagnose.engine.posterior import quantiles
from elevon.diagnose.positions.reading import PositionReading
from tests.diagnose.virtual import bench_logs

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
AT = (0.05, 0.5, 0.95)
KNOWN = {c.key: c for c in CANDIDATES}
FAULTS = {
    "backlash": ["backlash@transmission=0.13 deg"],
    "friction": ["friction@transmission=0.25"],
    "short": ["short@motor.phase_a=0.2"],
    "backlash and friction": ["backlash@transmission=0.13 deg", "friction@transmission=0.25"],
    "friction and short": ["friction@transmission=0.25", "short@motor.phase_a=0.2"],
}


@pytest.fixture(scope="module")
def frames():
    """One frame for each set of faults, and the candidates in it."""
    unit = Actuator.load("torino-rotary").with_values({"drive.kind": "pwm"})
    made = bench_logs(unit, [(1, [])] + [(k + 2, f) for k, f in enumerate(FAULTS.values())])
    base = PositionReading(made[0], unit)
    out = {}
    for (name, texts), item in zip(FAULTS.items(), made[1:], strict=True):
        few = [KNOWN[text.partition("=")[0]] for text in texts]
        case = case_of(PositionReading(item, unit), CANDIDATES, [base])
        residual = case.features.values - case.unit.mean
        frame = Frame(
            residual, case.covariance, case.unit.degrees, case.shift, case.errors, case.uncertainty
        )
        out[name] = (frame, few)
    return out


def density(frame, few, severities, *, fixed):
    """Log density of severities; the model's own errors as in `frame`, else where they are."""
    low, high = (np.array([getattr(c, end) for c in few]) for end in ("low", "high"))
    if not ((severities >= low) & (severities <= high)).all():
        return -np.inf
    frame_at = frame if fixed else frame.loosened(list(zip(few, severities, strict=True)))
    moved = [frame_at.shift(c.key, np.array([s])) for c, s in zip(few, severities, strict=True)]
    errors = [c.error * m for c, m in zip(few, moved, strict=True)]
    before = [prior_density(c, np.array([s]))[0] for c, s in zip(few, severities, strict=True)]
    return float(frame_at.log(frame_at.y - sum(moved), *errors)[0] + np.log(before).sum())


def sampled(frame, few, start, widths, *, steps, fixed):
    """Quantiles of each severity, and the sampler's error of each, by its own correlation time."""
    import emcee

    rng = np.random.default_rng(4)
    walkers = 8 * len(few)
    first = start + widths * rng.standard_normal((walkers, len(few)))
    first = np.clip(first, [c.low for c in few], [c.high for c in few])
    frame_at = frame.loosened(list(zip(few, start, strict=True))) if fixed else frame
    run = emcee.EnsembleSampler(walkers, len(few), lambda s: density(frame_at, few, s, fixed=fixed))
    run.random_state = np.random.RandomState(4).get_state()
    run.run_mcmc(first, steps)
    burn = steps // 5
    chain = run.get_chain(discard=burn, flat=True)
    count = len(chain) / run.get_autocorr_time(discard=burn, tol=0)
    spread = np.std(chain, axis=0)
    # Deviations of a Gaussian sample's quantiles at 5, 50 and 95 %, over sigma / sqrt(n).
    error = np.array([2.11, 1.25, 2.11])[:, None] * spread / np.sqrt(count)
    return np.quantile(chain, AT, axis=0), error, spread


def by_grids(frame, few):
    hypothesis = (
        one_fault(frame, few[0], 0.5) if len(few) == 1 else two_faults(frame, tuple(few), 0.5)
    )
    ends = [quantiles(g, w, AT) for g, w in zip(hypothesis.grids, hypothesis.weights, strict=True)]
    return hypothesis, np.array(ends).T


@pytest.mark.parametrize("name", ["friction", "backlash and friction"])
def test_grids_say_what_sampling_says(frames, name):
    frame, few = frames[name]
    hypothesis, ends = by_grids(frame, few)
    widths = (ends[2] - ends[0]) / 3.3
    chain, error, _ = sampled(frame, few, np.array(hypothesis.best), widths, steps=300, fixed=True)
    step = np.array([np.diff(grid).mean() for grid in hypothesis.grids])
    assert (np.abs(chain - ends) < 4.0 * error + 0.5 * step).all()


SHORT = pytest.param(
    "short",
    marks=pytest.mark.xfail(
        raises=AssertionError,
        strict=True,
        reason="nearly Gaussian features: median 0.4, upper end 0.5 deviations above the sampler's",
    ),
)
"""Not met. Grids with the errors at each severity say what the sampler says, but that is a median
of 0.182 where 0.2 was injected, not of 0.194."""


@pytest.mark.long
@pytest.mark.parametrize("name", [SHORT if name == "short" else name for name in FAULTS])
def test_the_models_own_error_may_be_fixed_at_the_best_severities(frames, name):
    """Sampling lets it grow with each severity; ends move by a fraction of the interval."""
    frame, few = frames[name]
    hypothesis, ends = by_grids(frame, few)
    widths = (ends[2] - ends[0]) / 3.3
    chain, error, spread = sampled(
        frame, few, np.array(hypothesis.best), widths, steps=1500, fixed=False
    )
    off = np.abs(chain - ends)
    assert (off < 4.0 * error + 0.25 * spread).all()


def test_where_the_sign_makes_no_difference_the_interval_has_both():
    """Shifts that are even in the severity: half of the mass lies on either side."""
    gain = next(c for c in CANDIDATES if c.key == "gain_drift@control.position")
    frame = Frame(
        np.array([4.0, 0.0]), np.eye(2), 200.0,
        lambda _key, s: np.column_stack([25.0 * np.abs(s), np.zeros(len(s))]), np.zeros(2),
    )  # fmt: skip
    result = one_fault(frame, gain, 1.0)
    (grid,), (weight,) = result.grids, result.weights
    assert float(weight[grid < 0.0].sum()) == pytest.approx(0.5, abs=0.02)
