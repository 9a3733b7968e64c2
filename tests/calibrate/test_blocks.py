"""Intervals hold under coloured residuals, which the textbook's do not."""

import numpy as np
import pytest
from scipy.signal import lfilter

from elevon.calibrate.blocks import block_covariance, block_length, stroke_blocks
from elevon.calibrate.estimate import quantile


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
        covariance, degrees = block_covariance(normal, [design * residual[:, None]], [blocks])
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
    covariance, _ = block_covariance(x.T @ x, [x], [np.arange(100) // 10])
    assert np.isinf(covariance).all()
