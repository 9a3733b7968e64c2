"""Which faults explain the features: single faults and pairs, by a Gaussian in the features.

The features of a log is y = m + shift(severities) + r. The covariance of r sums the spread from
run to run, the noise within the log, what is not known of the healthy mean m, and the model's own
error, which grows with the shift. Integrals over severities are sums over grids, fine where the
likelihood is: with one or two severities that is exact to the grid, and no sampling is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.candidates import CandidateFault
from elevon.diagnose.engine.likelihood import (
    Frame,
    Hypothesis,
    healthy_alone,
    one_fault,
    outside,
    second_faults,
    two_faults,
)

Shift = Callable[[str, Floats], Floats]
PRIOR_FAULTY = 0.5  # ASSUMED: a log is diagnosed since somebody doubts
OTHER = 0.02  # ASSUMED: a faulty unit has a fault that is no candidate
SECOND = 0.1  # ASSUMED: a faulty unit has a second fault
_FIRST = 6  # faults that a second one is sought beside, where not all pairs are scored


@dataclass(frozen=True)
class Posterior:
    """All hypotheses, most probable first, with their probabilities.

    Attributes
    ----------
    hypotheses, probabilities : tuple
        What is scored.
    other : float
        Probability of none of them: something moves the features that they do not explain.
    """

    hypotheses: tuple[Hypothesis, ...]
    probabilities: tuple[float, ...]
    other: float = 0.0

    def of(self, key: str) -> float:
        """Return the marginal probability of a fault."""
        pairs = zip(self.hypotheses, self.probabilities, strict=True)
        return float(sum(p for h, p in pairs if key in h.keys))

    @property
    def faulty(self) -> float:
        """Probability of any fault."""
        pairs = zip(self.hypotheses, self.probabilities, strict=True)
        return float(sum(p for h, p in pairs if h.keys)) + self.other


def posterior(
    residual: Floats,
    covariance: Floats,
    degrees: float,
    candidates: Sequence[CandidateFault],
    shift: Shift,
    *,
    errors: Floats | None = None,
    uncertainty: Callable[[str, float], Floats] | None = None,
    pairs: bool = True,
    other: bool = False,
    most: int | None = None,
) -> Posterior:
    """Score the hypotheses.

    Parameters
    ----------
    residual : ndarray, shape (k,)
        Features less its healthy mean.
    covariance : ndarray, shape (k, k)
        Of it, for a healthy unit.
    degrees : float
        Of freedom of Student's distribution: how well the spread is known.
    candidates : sequence of CandidateFault
        Faults.
    shift : callable
        Key and severities, shape (m,), to what they do to the features, shape (m, k).
    errors : ndarray, shape (k,), optional
        Deviation of each number's shift on its own, as a share of it; default: none.
    uncertainty : callable, optional
        Key and severity to a deviation that the fault gives the features, shape (k,).
    pairs : bool
        Whether two faults at once are scored.
    other : bool
        Whether something else may be there that moves the features anyhow; without candidates it
        is the only fault.
    most : int, optional
        Pairs that are scored: those that a coarse search beside the likeliest single faults finds
        best; the others count as impossible. Default: all.
    """
    shares = np.zeros(len(residual)) if errors is None else errors
    frame = Frame(residual, covariance, degrees, shift, shares, uncertainty)
    total = sum(c.rate for c in candidates)
    out = [healthy_alone(frame, 1.0 - PRIOR_FAULTY)]
    for c in candidates:
        out.append(one_fault(frame, c, PRIOR_FAULTY * (1.0 - SECOND) * c.rate / total))
    both = list(combinations(candidates, 2)) if pairs else []
    norm = sum(a.rate * b.rate for a, b in both) or 1.0
    if most is not None and len(both) > most:
        both = _promising(frame, candidates, out[1:], most)
    for a, b in both:
        out.append(two_faults(frame, (a, b), PRIOR_FAULTY * SECOND * a.rate * b.rate / norm))
    scores = np.array([h.evidence + np.log(h.prior) for h in out])
    if other:
        share = OTHER if candidates else 1.0
        scores = np.append(scores, outside(frame) + np.log(PRIOR_FAULTY * share))
    probability = np.exp(scores - scores.max())
    probability /= probability.sum()
    elsewhere = float(probability[len(out)]) if other else 0.0
    order = np.argsort(-probability[: len(out)])
    return Posterior(
        tuple(out[k] for k in order), tuple(float(probability[k]) for k in order), elsewhere
    )


def _promising(
    frame: Frame, candidates: Sequence[CandidateFault], singles: Sequence[Hypothesis], most: int
) -> list[tuple[CandidateFault, CandidateFault]]:
    """Pairs that may explain the features best: a second fault beside each of the likeliest."""
    known = {c.key: c for c in candidates}
    order = {c.key: k for k, c in enumerate(candidates)}
    ranked = sorted(singles, key=lambda h: -(h.evidence + float(np.log(h.prior))))
    scores: dict[tuple[str, str], float] = {}
    for h in ranked[:_FIRST]:
        first = known[h.keys[0]]
        for key, score in second_faults(frame, first, h.best[0], candidates).items():
            pair = (key, first.key) if order[key] < order[first.key] else (first.key, key)
            scores[pair] = max(score, scores.get(pair, -np.inf))
    best = sorted(scores, key=lambda pair: -scores[pair])[:most]
    return [(known[a], known[b]) for a, b in best]


def marginals(result: Posterior, key: str) -> tuple[Floats, Floats]:
    """Severities and weights of one fault, over all hypotheses that hold it."""
    grids, weights = [], []
    for h, p in zip(result.hypotheses, result.probabilities, strict=True):
        if key in h.keys:
            k = h.keys.index(key)
            grids.append(h.grids[k])
            weights.append(p * h.weights[k])
    grid, weight = np.concatenate(grids), np.concatenate(weights)
    order = np.argsort(grid)
    return grid[order], weight[order] / max(float(weight.sum()), 1e-300)


def quantiles(grid: Floats, weight: Floats, at: Sequence[float]) -> list[float]:
    """Quantiles of weighted points."""
    below = np.cumsum(weight) - 0.5 * weight
    return [float(np.interp(q, below, grid)) for q in at]
