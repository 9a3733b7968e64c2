"""A small network, several times over: what it says, and how it is trained, in NumPy alone.

Each member is a perceptron with tanh layers. For every fault it gives the logit of its presence,
and mean and logarithm of the deviation of its size; one more logit says that anything is wrong.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Numbers = npt.NDArray[Any]  # of double precision, but of single in training
Weights = list[Numbers]  # w1, b1, w2, b2, ...
HIDDEN = (44, 44)
_LEAST_LOG, _MOST_LOG = -5.0, 1.5  # of a deviation
_PART = 64  # rows of a product
_SINGLE = np.float32
DECAY = 0.2  # of the weights, over the step's rate: less of it, and the units are learned by heart


@dataclass(frozen=True)
class Batch:
    """What a member is trained on.

    Attributes
    ----------
    inputs : ndarray, shape (n, m)
        Normalised.
    size : ndarray, shape (n, f)
        Of each fault, scaled to its range; zero where absent.
    """

    inputs: Numbers
    size: Numbers


@dataclass(frozen=True)
class Opinion:
    """What an ensemble says of n inputs.

    Attributes
    ----------
    presence : ndarray, shape (n, f)
        Logit of each fault, not yet calibrated.
    faulty : ndarray, shape (n,)
        Logit of any fault.
    size, deviation : ndarray, shape (n, f)
        Of each fault, were it there.
    each : ndarray, shape (e, n, f)
        Of every member: logit of each fault.
    """

    presence: Numbers
    faulty: Numbers
    size: Numbers
    deviation: Numbers
    each: Numbers


@dataclass(frozen=True)
class Ensemble:
    """Networks of one shape, trained from different starts.

    Attributes
    ----------
    weights : list of ndarray, shape (e, a, b) or (e, 1, b)
        Of all members, layer by layer.
    """

    weights: Weights

    def says(self, inputs: Numbers) -> Opinion:
        """Return the ensemble's opinion of inputs, shape (n, m): the members' means.

        How far the members disagree does not enter the deviation: it depends on their number, and
        calibration is made on some of them.
        """
        out = _forward(self.weights, np.asarray(inputs)[None, :, :])[-1]
        count = (out.shape[2] - 1) // 3
        size, log = out[..., count : 2 * count], out[..., 2 * count : 3 * count]
        variance = np.exp(2.0 * np.clip(log, _LEAST_LOG, _MOST_LOG)).mean(axis=0)
        return Opinion(
            out[..., :count].mean(axis=0),
            out[..., -1].mean(axis=0),
            size.mean(axis=0),
            np.sqrt(variance),
            out[..., :count],
        )


def _forward(weights: Sequence[Numbers], inputs: Numbers) -> list[Numbers]:
    layers = [inputs]
    last = len(weights) // 2 - 1
    for k in range(last + 1):
        out = layers[-1] @ weights[2 * k] + weights[2 * k + 1]
        layers.append(out if k == last else np.tanh(out))
    return layers


def loss_and_gradient(weights: Weights, batch: Batch) -> tuple[float, Weights]:
    """Return the mean loss of one member, and its gradient.

    Cross entropy of presence and of any fault, and the Gaussian's negative log likelihood of the
    sizes of those that are there.
    """
    layers = _forward(weights, _parts(batch.inputs))
    out, there = np.concatenate(layers[-1]), (batch.size != 0.0).astype(batch.inputs.dtype)
    n, f = there.shape
    size, raw = out[:, f : 2 * f], out[:, 2 * f : 3 * f]
    log = np.clip(raw, _LEAST_LOG, _MOST_LOG)
    score = (batch.size - size) * np.exp(-log)
    any_ = there.max(axis=1)
    loss = (
        float(
            np.sum(_entropy(out[:, :f], there))
            + np.sum(_entropy(out[:, -1], any_))
            + np.sum(there * (0.5 * score**2 + log))
        )
        / n
    )
    slope = np.empty_like(out)
    slope[:, :f] = _logistic(out[:, :f]) - there
    slope[:, f : 2 * f] = -there * score * np.exp(-log)
    slope[:, 2 * f : 3 * f] = there * (1.0 - score**2) * (raw == log)
    slope[:, -1] = _logistic(out[:, -1]) - any_
    return loss, _backward(weights, layers, _parts(slope / n))


def _parts(rows: Numbers) -> Numbers:
    """Return rows in parts of 64, shape (p, 64, k), or as one where they do not divide.

    A product of this size stays on one thread: linear algebra that waits for a second one on a
    machine at work takes twenty times as long.
    """
    return rows.reshape(-1, _PART if len(rows) % _PART == 0 else len(rows), rows.shape[1])


def _entropy(logit: Numbers, there: Numbers) -> Numbers:
    return np.asarray(np.logaddexp(0.0, logit) - there * logit)


def honest(scaling: Numbers, logit: Numbers) -> Numbers:
    """Return calibrated logits, shape (..., k): one slope for each side, and an offset.

    Parameters
    ----------
    scaling : ndarray, shape (k, 3)
        Slope where the logit is negative, where it is positive, offset (beta calibration; Kull,
        Silva Filho and Flach, 2017).
    logit : ndarray, shape (..., k)
        As the networks give it.
    """
    absent, there = -np.logaddexp(0.0, -logit), np.logaddexp(0.0, logit)
    return np.asarray(scaling[:, 0] * absent + scaling[:, 1] * there + scaling[:, 2])


def either(logit: Numbers) -> Numbers:
    """Return the logit, shape (...), that any of independent faults, shape (..., f), is there."""
    none = np.logaddexp(0.0, logit).sum(axis=-1)  # -log of the product of all absences
    return np.asarray(none + np.log(-np.expm1(-none)))


def _logistic(logit: Numbers) -> Numbers:
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * logit)))


def _backward(weights: Weights, layers: list[Numbers], slope: Numbers) -> Weights:
    out: Weights = [np.zeros(0)] * len(weights)
    for k in range(len(weights) // 2 - 1, -1, -1):
        out[2 * k] = (layers[k].swapaxes(1, 2) @ slope).sum(axis=0)
        out[2 * k + 1] = slope.sum(axis=(0, 1))[None, :]
        if k:
            slope = (slope @ weights[2 * k].T) * (1.0 - layers[k] ** 2)
    return out


def train(
    batches: Callable[[np.random.Generator], Batch],
    outputs: int,
    *,
    members: int,
    rounds: int,
    seed: int,
    progress: Callable[[float], object] | None = None,
) -> Ensemble:
    """Train the members by Adam with a rate that falls to nothing, in single precision.

    Parameters
    ----------
    batches : callable
        Random generator to a batch.
    outputs : int
        Of a member: three for each fault and one more.
    members, rounds : int
        Networks; steps of each.
    seed : int
        Of starts and batches.
    progress : callable, optional
        Told the done fraction; False stops (`Interrupted`).
    """
    from elevon.errors import Interrupted

    all_weights = []
    for k in range(members):
        if progress is not None and progress(k / members) is False:
            raise Interrupted("training was interrupted")
        rng = np.random.default_rng([seed, k])
        all_weights.append(_member(batches, outputs, rounds, rng))
    layers = zip(*all_weights, strict=True)
    return Ensemble([np.stack(layer).astype(np.float64) for layer in layers])


def _member(
    batches: Callable[[np.random.Generator], Batch],
    outputs: int,
    rounds: int,
    rng: np.random.Generator,
) -> Weights:
    widths = (batches(rng).inputs.shape[1], *HIDDEN, outputs)
    weights: Weights = []
    for a, b in itertools.pairwise(widths):
        start = rng.standard_normal((a, b)) / math.sqrt(a)
        weights += [start.astype(_SINGLE), np.zeros((1, b), dtype=_SINGLE)]
    mean = [np.zeros_like(w) for w in weights]
    square = [np.zeros_like(w) for w in weights]
    for step in range(1, rounds + 1):
        drawn = batches(rng)
        drawn = Batch(drawn.inputs.astype(_SINGLE), drawn.size.astype(_SINGLE))
        _, gradient = loss_and_gradient(weights, drawn)
        rate = 4e-3 * 0.5 * (1.0 + math.cos(math.pi * step / rounds))
        for k, g in enumerate(gradient):
            mean[k] += 0.1 * (g - mean[k])
            square[k] += 0.01 * (g * g - square[k])
            way = mean[k] / (1.0 - 0.9**step)
            size = np.sqrt(square[k] / (1.0 - 0.99**step)) + 1e-8
            weights[k] = weights[k] - rate * (way / size + DECAY * weights[k])
    return weights


def stored(ensemble: Ensemble) -> Ensemble:
    """Return an ensemble of the half precision that a file keeps."""
    return Ensemble([w.astype(np.float16).astype(np.float64) for w in ensemble.weights])
