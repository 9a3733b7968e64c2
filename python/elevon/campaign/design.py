"""A designed experiment: its points, replicates, blocks and order, and what is aliased."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.campaign.draw import ranged, read_values, sample
from elevon.campaign.grammar import Design, Factor, Power, Target
from elevon.campaign.twolevel import (
    Fraction,
    block_words,
    blocks_of,
    fraction,
    full,
    letters,
    plackett_burman,
    plackett_burman_runs,
    spelled,
)
from elevon.errors import InputError, unknown
from elevon.files import read_regular
from elevon.series import LONGEST


def power_rows(
    request: Power,
    coded: Floats,
    blocks: npt.NDArray[np.int64],
    names: Sequence[str],
    place: str,
) -> list[dict[str, object]]:
    """Return the power of each effect of interest.

    The model has a mean, the blocks, every factor and the interactions of interest; the effect is
    tested by Student's t, two-sided. Under the alternative t is noncentral with
    effect / (2 sd sqrt(v)), v the effect's diagonal entry of (X' X)^-1 (Montgomery, Design and
    Analysis of Experiments, ch. 3 and 10).

    Parameters
    ----------
    request : Power
        Size of the effect, spread, level, terms.
    coded : ndarray, shape (runs, factors)
        The design, -1 to +1.
    blocks : ndarray, shape (runs,)
        Block of each run.
    names : sequence of str
        The factors' letters.
    place : str
        Named in errors.

    Returns
    -------
    list of dict
        ``term``, ``power`` (None where it cannot be computed), ``df`` and ``note``.
    """
    terms = list(request.terms or names)
    interactions = [term for term in terms if term not in names]
    columns = {name: coded[:, k] for k, name in enumerate(names)}
    for term in interactions:
        columns[term] = _interaction(term, coded, names, place)
    head = [np.ones(len(coded)), *((blocks == b).astype(float) for b in np.unique(blocks)[1:])]
    matrix = np.column_stack([*head, *columns.values()])
    rank = int(np.linalg.matrix_rank(matrix))
    freedom = len(coded) - rank
    inverse = np.linalg.pinv(matrix.T @ matrix)
    places = {name: len(head) + k for k, name in enumerate(columns)}
    return [_power_row(request, term, places[term], matrix, inverse, freedom) for term in terms]


def _interaction(term: str, coded: Floats, names: Sequence[str], place: str) -> Floats:
    parts = term.split(":") if ":" in term else list(term)
    for part in parts:
        if part not in names:
            raise unknown("factor", part, names, place)
    product: Floats = coded[:, [list(names).index(part) for part in parts]].prod(axis=1)
    return product


def _power_row(  # noqa: PLR0917 - one line of a table, all of it needed
    request: Power, term: str, column: int, matrix: Floats, inverse: Floats, freedom: int
) -> dict[str, Any]:
    from scipy.stats import nct, t

    others = np.delete(matrix, column, axis=1)
    aliased = np.linalg.matrix_rank(others) == np.linalg.matrix_rank(matrix)
    if aliased or freedom < 1:
        note = "aliased with other terms" if aliased else "no degrees of freedom for the spread"
        return {"term": term, "power": None, "df": freedom, "note": note}
    error = request.sd * np.sqrt(inverse[column, column])
    shift = 0.5 * request.effect / error
    limit = t.ppf(1.0 - 0.5 * request.alpha, freedom)
    power = nct.sf(limit, freedom, shift) + nct.cdf(-limit, freedom, shift)
    return {"term": term, "power": float(power), "df": freedom, "note": ""}


Ints = npt.NDArray[np.int64]

_ROMAN = {3: "III", 4: "IV", 5: "V", 6: "VI", 7: "VII", 8: "VIII"}
_TWO_LEVEL = {"fractional_factorial", "plackett_burman"}


@dataclass
class Points:
    """The runs of a design, in the order in which they stand.

    Attributes
    ----------
    targets, columns : list
        The factors (and the blocks' quantity), with unit and value in each run.
    draw, block, replicate : ndarray of int, shape (runs,)
        Point of the design, block and replicate of each run.
    about : dict
        What the design is, in JSON's types: resolution, generators, aliases, power.
    """

    targets: list[Target]
    columns: list[tuple[str, Any]]
    draw: Ints
    block: Ints
    replicate: Ints
    about: dict[str, Any] = field(default_factory=dict)


def design_points(design: Design, wiring: str, folder: Path | None, place: str) -> Points:
    """Return the runs of a design.

    Raises
    ------
    InputError
        The design cannot be: the place is named.
    """
    names = _factor_letters(design, place)
    _check_keys(design, place)
    regular = _regular_fraction(design, names, place)
    if design.kind == "table":
        return _order_runs(
            design, _read_point_table(design, wiring, names, folder, place), wiring, place
        )
    coded = _coded_points(design, regular, place)
    if not len(coded):
        raise InputError(f"{place}: the design is empty: it holds no point")
    points = _replicate_in_blocks(design, coded, regular, place)
    draw, block, replicate, whole = points
    columns = [
        _factor_values(design, factor, whole[:, k], wiring, f"{place}.factor[{k}]")
        for k, factor in enumerate(design.factor)
    ]
    result = Points(list(design.factor), columns, draw, block, replicate)
    result.about = _describe_design(design, regular, names, place)
    if design.power is not None:
        result.about["power"] = power_rows(design.power, whole, block, names, f"{place}.power")
    return _order_runs(design, result, wiring, place)


def _factor_letters(design: Design, place: str) -> list[str]:
    usual = letters(len(design.factor))
    if len(usual) < len(design.factor):
        raise InputError(f"{place}: {len(design.factor)} factors are more than {len(usual)}")
    names = [f.letter or usual[k] for k, f in enumerate(design.factor)]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{place}: the letter {name!r} is given twice")
    return names


def _check_keys(design: Design, place: str) -> None:
    """Refuse keys that the kind of design has no use for: they would be ignored."""
    sampled = design.kind in {"latin_hypercube", "sobol", "random"}
    if sampled == (design.count is None):
        raise InputError(
            f"{place}: {design.kind} {'needs' if sampled else 'has no use for'} 'count'"
        )
    allowed = {
        "generators": design.kind == "fractional_factorial",
        "runs": design.kind in _TWO_LEVEL,
        "centre": design.kind in _TWO_LEVEL | {"full_factorial"},
        "file": design.kind == "table",
        "block_generators": design.kind in {"full_factorial", "fractional_factorial"},
    }
    for key, useful in allowed.items():
        if getattr(design, key) and not useful:
            raise InputError(f"{place}: {design.kind} has no use for {key!r}")
    if design.kind == "table" and design.file is None:
        raise InputError(f"{place}: a table needs 'file'")
    for k, factor in enumerate(design.factor):
        if factor.probability < 1.0:
            raise InputError(f"{place}.factor[{k}]: a factor has no 'probability'")


def _regular_fraction(design: Design, names: list[str], place: str) -> Fraction | None:
    """Return the regular two-level design that this one is, None where it is none."""
    two = all(f.values is None or len(f.values) == 2 for f in design.factor)
    if design.kind == "fractional_factorial":
        if not two:
            raise InputError(f"{place}: every factor of a fraction has two levels")
        return fraction(names, place, design.generators, design.runs)
    return full(names) if design.kind == "full_factorial" and two else None


def _coded_points(design: Design, regular: Fraction | None, place: str) -> Floats:
    """Return the points, -1 to +1; of a full factorial of several levels their numbers."""
    factors = len(design.factor)
    if regular is not None:
        if regular.runs > _MOST_POINTS:
            raise InputError(f"{place}: {regular.runs} points are more than {_MOST_POINTS}")
        return regular.coded()
    if design.kind == "full_factorial":
        levels = [2 if f.values is None else len(f.values) for f in design.factor]
        if np.prod(levels, dtype=float) > _MOST_POINTS:
            raise InputError(f"{place}: more than {_MOST_POINTS} points")
        grid = np.indices(levels[::-1]).reshape(factors, -1)[::-1].T
        coded: Floats = 2.0 * grid / (np.array(levels) - 1.0).clip(1.0) - 1.0
        return coded
    if design.kind == "plackett_burman":
        runs = design.runs or plackett_burman_runs(factors, place)
        return plackett_burman(factors, runs, place)
    count = design.count or 0
    return 2.0 * sample(design.kind, (count, factors), design.seed, 1, place) - 1.0


_MOST_POINTS = 1_000_000


def _replicate_in_blocks(
    design: Design, coded: Floats, regular: Fraction | None, place: str
) -> tuple[Ints, Ints, Ints, Floats]:
    """Add centre points and replicates, and deal the runs to the blocks."""
    centre = np.zeros((design.centre, coded.shape[1]))
    one = np.vstack([coded, centre])
    points, copies = len(one), design.replicates
    draw = np.tile(np.arange(points), copies)
    replicate = np.repeat(np.arange(copies), points)
    if design.blocks == 1:
        block = np.zeros(points * copies, dtype=np.int64)
    elif copies % design.blocks == 0 and not design.block_generators:
        block = replicate * design.blocks // copies
    elif regular is not None:
        words = block_words(regular, design.blocks, place, design.block_generators)
        point_blocks = np.concatenate(
            [blocks_of(coded, words), np.arange(design.centre) % design.blocks]
        )
        block = np.tile(point_blocks, copies)
    else:
        raise InputError(
            f"{place}: {design.blocks} blocks of {points} points in {copies} replicate(s): give a "
            "multiple of as many replicates, or a regular two-level design"
        )
    return draw, block, replicate, np.tile(one, (copies, 1))


def _factor_values(
    design: Design, factor: Factor, coded: Floats, wiring: str, place: str
) -> tuple[str, Any]:
    fractions = 0.5 * (coded + 1.0)
    if factor.values is None:
        return ranged(factor, fractions, wiring, place)
    unit, levels = read_values(factor, list(factor.values), wiring, place)
    if design.centre and (fractions == 0.5).any():
        raise InputError(f"{place}: centre points need factors with 'from' and 'to'")
    if design.kind == "full_factorial" or design.kind in _TWO_LEVEL:
        chosen = np.rint(fractions * (len(levels) - 1)).astype(int)
    else:
        chosen = np.minimum((fractions * len(levels)).astype(int), len(levels) - 1)
    return unit, levels[chosen]


def _read_point_table(
    design: Design, wiring: str, names: list[str], folder: Path | None, place: str
) -> Points:
    """Read a table of the caller: a title for each factor (letter or name), a row a point."""
    path = Path(str(design.file)).expanduser()
    path = path if path.is_absolute() or folder is None else folder / path
    try:
        text = read_regular(path, LONGEST).decode("utf-8-sig")
        reader = csv.reader(io.StringIO(text, newline=""))
        rows = [row for row in reader if any(cell.strip() for cell in row)]
    except UnicodeDecodeError as error:
        raise InputError(f"{place}: {path} cannot be read: is not UTF-8 text") from error
    except (csv.Error, ValueError) as error:
        raise InputError(f"{place}: {error}") from error
    if len(rows) < 2:
        raise InputError(f"{place}: {path}: the design is empty: it holds no point")
    titles = [cell.strip() for cell in rows[0]]
    columns = []
    for k, factor in enumerate(design.factor):
        wanted = [title for title in titles if title in {names[k], factor.name}]
        if len(wanted) != 1:
            raise InputError(f"{place}: {path}: no column {names[k]!r} or {factor.name!r}")
        cells = [_cell(row, titles.index(wanted[0]), path, place) for row in rows[1:]]
        columns.append(read_values(factor, cells, wiring, f"{place}: {path}"))
    _check_titles(titles, names, design, path, place)
    points = len(rows) - 1
    copies = design.replicates
    if copies % design.blocks:
        raise InputError(f"{place}: {design.blocks} blocks need a multiple of as many replicates")
    replicate = np.repeat(np.arange(copies), points)
    tiled = [(unit, np.tile(values, copies)) for unit, values in columns]
    return Points(
        list(design.factor),
        tiled,
        np.tile(np.arange(points), copies),
        replicate * design.blocks // copies,
        replicate,
        {"kind": "table", "points": points, "factors": _factor_rows(design, names)},
    )


def _check_titles(
    titles: Sequence[str], names: Sequence[str], design: Design, path: Path, place: str
) -> None:
    known = {*names, *(factor.name for factor in design.factor)}
    for title in titles:
        if title not in known:
            raise InputError(f"{place}: {path}: column {title!r} is no factor of the plan")


def _cell(row: Sequence[str], index: int, path: Path, place: str) -> Any:
    if index >= len(row):
        raise InputError(f"{place}: {path}: a row has too few cells: {','.join(row)!r}")
    text = row[index].strip()
    try:
        return float(text)
    except ValueError:
        return text


def _factor_rows(design: Design, names: Sequence[str]) -> list[dict[str, str]]:
    return [
        {"letter": name, "name": factor.name, "role": factor.role}
        for name, factor in zip(names, design.factor, strict=True)
    ]


def _describe_design(
    design: Design, regular: Fraction | None, names: list[str], place: str
) -> dict[str, Any]:
    about: dict[str, Any] = {
        "kind": design.kind,
        "factors": _factor_rows(design, names),
        "replicates": design.replicates,
        "blocks": design.blocks,
        "centre": design.centre,
    }
    if design.kind == "plackett_burman":
        about["resolution"] = "III"
    if regular is not None and regular.generators:
        resolution = regular.resolution or 0
        about["resolution"] = _ROMAN.get(resolution, str(resolution))
        about["generators"] = [
            f"{names[f]}={'-' if sign < 0 else ''}{spelled(word, names)}"
            for f, word, sign in regular.generators
        ]
        about["defining_words"] = [
            ("-" if sign < 0 else "") + spelled(word, names)
            for word, sign in sorted(regular.words.items(), key=lambda p: (p[0].bit_count(), p[0]))
        ]
        about["aliases"] = regular.aliases()
    if regular is not None and design.blocks > 1 and design.replicates % design.blocks:
        words = block_words(regular, design.blocks, place, design.block_generators)
        about["block_words"] = [spelled(word, names) for word in words]
    return about


def _order_runs(design: Design, points: Points, wiring: str, place: str) -> Points:
    """Put the runs in order: block by block, within them as designed or at random."""
    count = len(points.draw)
    generator = np.random.default_rng(design.order_seed)
    key = generator.permutation(count) if design.randomise else np.arange(count)
    order = np.lexsort((key, points.block))
    points.draw, points.block = points.draw[order], points.block[order]
    points.replicate = points.replicate[order]
    points.columns = [(unit, values[order]) for unit, values in points.columns]
    points.about["randomised"] = design.randomise
    if design.blocking is not None:
        values = list(design.blocking.values)
        if len(values) != design.blocks:
            raise InputError(f"{place}.blocking: {len(values)} values for {design.blocks} block(s)")
        unit, levels = read_values(design.blocking, values, wiring, f"{place}.blocking")
        points.targets.append(design.blocking)
        points.columns.append((unit, levels[points.block]))
    return points
