"""Draws that every threshold stands on, made once: the same ones for the same log of an answer."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from elevon.arrays import Floats

_REMEMBERED = 8  # arrays; one of a servo's features takes 3 MB


@lru_cache(maxsize=_REMEMBERED)
def normal(count: int, width: int, seed: tuple[int, ...]) -> Floats:
    """Draw of the standard normal distribution, shape (count, width)."""
    out = np.random.default_rng(seed).standard_normal((count, width))
    out.flags.writeable = False
    return out


@lru_cache(maxsize=_REMEMBERED)
def chi_square(count: int, degrees: tuple[float, ...], seed: tuple[int, ...]) -> Floats:
    """Draw of chi-square, a column for each number of degrees, shape (count, k)."""
    out = np.random.default_rng(seed).chisquare(degrees, (count, len(degrees)))
    out.flags.writeable = False
    return out


@lru_cache(maxsize=_REMEMBERED)
def uniform(count: int, seed: tuple[int, ...]) -> Floats:
    """Draw between nought and one, shape (count,)."""
    out = np.random.default_rng(seed).random(count)
    out.flags.writeable = False
    return out
