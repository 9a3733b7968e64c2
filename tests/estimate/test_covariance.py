"""Intervals hold under coloured residuals, which the textbook's do not."""

import numpy as np
import pytest
from scipy.signal import lfilter

from elevon.estimate import quantile
from elevon.estimate.covariance import (
    block_covariance,
    block_length,
    block_sums,
    correlated,
    joined,
    memory,
    robust_covariance,
    stroke_blocks,
)


@pytest.mark.parametrize("rho", [0.0, 0.9, 0.98])
def test_blocks_cover(rho):
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 20.0, 0.0025)
    speed = np.cos(2 * np.pi * 0.5 * time)
    design = np.column_stack((speed, np.sign(speed), np.ones_like(time)))
    normal = design.T @ design
    solver = np.linalg.solve(normal, design.T)
    hits = white = 0
    for _ in range(150):
        drive = rng.normal(0.0, np.sqrt(1 - rho**2), len(time) + 2000)
        noise = lfilter([1.0], [1.0, -rho], drive)[2000:]
        wrong = solver @ noise
        residual = noise - design @ wrong
        blocks = stroke_blocks(time, speed, residual, 0.0025)
        covariance, degrees = block_covariance(normal, design * residual[:, None], blocks)
        hits += int(np.sum(np.abs(wrong) < quantile(degrees) * np.sqrt(np.diag(covariance))))
        plain = np.sqrt(np.diag(np.linalg.inv(normal)) * residual.var())
        white += int(np.sum(np.abs(wrong) < 1.645 * plain))
    assert 0.83 <= hits / 450 <= 0.97
    if rho > 0.5:
        assert white / 450 < 0.6


def test_blocks_are_whole_strokes_and_long_enough():
    time = np.arange(0.0, 20.0, 0.0025)
    speed = np.sin(2 * np.pi * 0.5 * time + 0.1)
    residual = np.random.default_rng(1).normal(size=len(time))
    blocks = stroke_blocks(time, speed, residual, 0.0025)
    assert np.all(np.diff(blocks) >= 0)
    edges = np.flatnonzero(np.diff(blocks)) + 1
    assert np.all(np.sign(speed[edges]) != np.sign(speed[edges - 1]))
    assert len(edges) >= 7


def test_memory_lengthens_a_block():
    rng = np.random.default_rng(2)
    white = rng.normal(size=8000)
    coloured = lfilter([1.0], [1.0, -0.995], white)
    assert block_length(white, 0.0025) == 0.25
    assert block_length(coloured, 0.0025) > 1.0


def test_an_undetermined_parameter_has_no_finite_deviation():
    x = np.ones((100, 2))
    covariance, _ = block_covariance(x.T @ x, x, np.arange(100) // 10)
    assert np.isinf(covariance).all()


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.9])
def test_the_mean_of_a_first_order_process(rho):
    """Variance of a mean of n samples of AR(1): sigma^2/n (1 + rho)/(1 - rho) for long records."""
    count, level = 20_000, []
    design = np.ones((count, 1))
    true = (1.0 + rho) / (1.0 - rho) / (1.0 - rho**2) / count
    for seed in range(8):
        noise = lfilter([1.0], [1.0, -rho], np.random.default_rng(seed).normal(size=count))
        level.append(robust_covariance(design, noise - noise.mean())[0, 0])
        blocks = np.arange(count) // 200
        covariance, degrees = block_covariance(
            design.T @ design, design * (noise - noise.mean())[:, None], blocks
        )
        level.append(covariance[0, 0])
        assert degrees == count / 200 - 1
    assert np.mean(level) == pytest.approx(true, rel=0.15)
    assert memory(noise) == pytest.approx((1.0 + rho) / (1.0 - rho), rel=0.15)
    assert correlated(noise) == pytest.approx((1.0 + rho) / (1.0 - rho), rel=0.2)


def test_what_is_believed_counts_like_data():
    """A prior of information I and no data: covariance 1/I; with data it only gets smaller."""
    rng = np.random.default_rng(4)
    design = rng.normal(size=(4000, 2))
    scores, blocks = design * rng.normal(size=(4000, 1)), np.arange(4000) // 10
    belief = np.diag([4.0, 1e8])
    covariance, _ = block_covariance(design.T @ design, scores, blocks, prior=belief)
    alone = block_covariance(design.T @ design, scores, blocks)[0]
    assert covariance[1, 1] == pytest.approx(1e-8, rel=0.01)
    assert covariance[0, 0] == pytest.approx(alone[0, 0], rel=0.05)


def test_blocks_of_logs_share_no_number():
    blocks = joined([np.array([3, 3, 4]), np.array([0, 1, 1])])
    assert blocks.tolist() == [0, 0, 1, 2, 3, 3]
    assert block_sums(np.ones((6, 1)), blocks).ravel().tolist() == [2.0, 1.0, 1.0, 2.0]
