"""A response and the factors of a campaign, run by run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.campaign import Dataset
from elevon.errors import InputError, unknown

Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class VariedFactor:
    """A varied quantity.

    Attributes
    ----------
    letter, name, unit, role : str
        How it is called.
    values : ndarray, shape (runs,)
        SI; of a quantity that is no number, the place of the value among `levels`.
    levels : tuple
        The different values, in order.
    """

    letter: str
    name: str
    unit: str
    role: str
    values: Floats
    levels: tuple[Any, ...]

    @property
    def coded(self) -> Floats:
        """Values from -1 (the least) to +1 (the largest)."""
        low, high = float(self.values.min()), float(self.values.max())
        coded: Floats = (2.0 * self.values - (low + high)) / (high - low)
        return coded


@dataclass(frozen=True)
class CampaignResponse:
    """A response of a campaign's runs.

    Attributes
    ----------
    name, unit : str
        What it is.
    run, point, block : ndarray of int, shape (runs,)
        Number of the run, point of the design, block of the experiment.
    values : ndarray, shape (runs,)
        SI.
    factors : list of Factor
        What varied, but for what goes with the blocks.
    with_blocks : list of str
        What varies with the blocks alone.
    left_out : list of int
        Runs without a value: not finished, failed, or a feature that their motion does not give.
    """

    name: str
    unit: str
    run: Ints
    point: Ints
    block: Ints
    values: Floats
    factors: list[VariedFactor]
    with_blocks: list[str]
    left_out: list[int]


def read_response(ds: Dataset, name: str) -> CampaignResponse:
    """Read a response of a campaign: a feature, or a number in the table of the runs.

    Raises
    ------
    UnknownNameError
        No such response.
    InputError
        Nothing varies, or no run has a value.
    """
    runs = ds.runs.to_arrow()
    values, unit = _response_values(ds, name, runs)
    ended = np.isin(runs["status"].to_pylist(), ["ok", "tripped"])
    good = np.isfinite(values) & ended
    numbers = runs["run"].to_numpy()
    if not good.any():
        raise InputError(f"{ds.folder}: no run has a value of {name!r}")
    block = runs["block"].to_numpy()[good]
    factors, with_blocks = _varied_factors(ds, runs, good, block)
    if not factors:
        raise InputError(f"{ds.folder}: nothing varies among the runs with a value of {name!r}")
    return CampaignResponse(
        name,
        unit,
        numbers[good],
        runs["draw"].to_numpy()[good],
        block,
        values[good],
        factors,
        with_blocks,
        numbers[~good].tolist(),
    )


def _response_values(ds: Dataset, name: str, runs: Any) -> tuple[Floats, str]:
    """Return the response of every run, NaN where there is none."""
    known = ["sim_s"]
    values = np.full(len(ds), np.nan)
    if name in known:
        return runs[name].to_numpy().astype(np.float64), "s"
    if ds.manifest.status == "running" or any(
        file.startswith("features/") for item in ds.items for file in item.files
    ):
        features = ds.features
        known += [column for column in features.columns if column != "run"]
        if name in known:
            table = features.to_arrow(["run", name])
            values[table["run"].to_numpy()] = table[name].to_numpy()
            return values, features.units[name]
    raise unknown("response", name, known, f"{ds.folder}")


def _varied_factors(
    ds: Dataset, runs: Any, good: npt.NDArray[np.bool_], block: Ints
) -> tuple[list[VariedFactor], list[str]]:
    design = {item["name"]: item for item in ds.manifest.design.get("factors", [])}
    factors, with_blocks = [], []
    taken = {item["letter"] for item in design.values()}
    free = (letter for letter in "ABCDEFGHJKLMNOPQRSTUVWXYZ" if letter not in taken)
    for column in ds.manifest.columns:
        name = column["name"]
        values, levels = _numeric_levels(runs[name], good)
        if len(levels) < 2:
            continue
        if len(np.unique(block)) > 1 and _varies_with_blocks(values, block):
            with_blocks.append(name)
            continue
        known = design.get(name)
        letter = known["letter"] if known else next(free, name)
        factors.append(
            VariedFactor(letter, name, column["unit"] or "1", column["role"], values, levels)
        )
    return factors, with_blocks


def _numeric_levels(column: Any, good: npt.NDArray[np.bool_]) -> tuple[Floats, tuple[Any, ...]]:
    """Return a column as numbers: its own, or the place of each among its sorted values."""
    values = np.array(column.to_pylist(), dtype=object)[good]
    if all(isinstance(value, (int, float)) for value in values):
        numbers = values.astype(np.float64)
        return numbers, tuple(np.unique(numbers).tolist())
    levels = sorted({str(value) for value in values})
    place = {level: index for index, level in enumerate(levels)}
    return np.array([float(place[str(value)]) for value in values]), tuple(levels)


def _varies_with_blocks(values: Floats, block: Ints) -> bool:
    """Return whether a quantity has one value in each block."""
    return all(len(np.unique(values[block == number])) == 1 for number in np.unique(block))
