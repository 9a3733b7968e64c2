"""Real histories to the end: Virkler's cracks, and public sets that the reader brings.

A public set is a folder of CSV files ``use,severity,sd``, one a unit, and a file ``limit.txt``
with the value at which life ends. They are predicted as `elevon predict --limit` does it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.prognose import Inspection
from elevon.prognose.value_history import VALUE, ValueHistory, read_value_history, value_tables
from studies.lives.baselines import BASELINES
from studies.lives.judge import OURS, remaining, scored

_START, _LIMIT = 9.0, 49.8  # mm, first and last length of the tests
_ERROR = (0.01, 0.1)  # of the length, and mm: deviation of an inspection; ASSUMED
_SHARES = (0.5, 0.7, 0.9)  # of life, at which a real unit is predicted
_MOST = 40  # inspections of a public history that are taken, evenly
_FAR = 20.0


@lru_cache(maxsize=1)
def cracks() -> tuple[Floats, Floats]:
    """Return lengths [mm], shape (9,), and cycles at which each specimen had them, (68, 9)."""
    text = (files("studies.lives") / "virkler.csv").read_text("ascii")
    rows = [line.split(",") for line in text.splitlines() if not line.startswith("#")]
    table = np.array(rows, dtype=np.float64)
    cycles = np.column_stack((np.zeros(len(table) - 1), 1e3 * table[1:]))
    return np.concatenate(([_START], table[0])), cycles


def crack_history(number: int, seed: int) -> tuple[ValueHistory, float]:
    """Return one specimen's inspections, irregular and with errors, and its end.

    Between two lengths that were noted the logarithm of the length is a straight line over cycles.
    """
    length, cycles = cracks()
    rng = np.random.default_rng([68, seed, number])
    end = float(cycles[number, -1])
    count = round(float(np.exp(rng.uniform(np.log(4.0), np.log(40.0)))))
    uses = np.sort(rng.uniform(0.03, 0.95, count)) * end
    seen = []
    for use in uses.tolist():
        true = float(np.exp(np.interp(use, cycles[number], np.log(length))))
        deviation = float(np.hypot(_ERROR[0] * true, _ERROR[1]))
        value = true + deviation * float(rng.standard_normal())
        seen.append(_inspection(use, value, deviation, _START, _LIMIT))
    return ValueHistory(f"crack {number}", tuple(seen), _START, _LIMIT, "mm", "cycles"), end


def _inspection(use: float, value: float, sd: float, start: float, limit: float) -> Inspection:
    from elevon.prognose import Seen

    share, deviation = (value - start) / (limit - start), sd / abs(limit - start)
    return Inspection(use, {VALUE: Seen(share, deviation, deviation)})


def public_histories(folder: Path) -> list[tuple[ValueHistory, float]]:
    """Return the units of a public set until their ends; units that do not end are left out.

    Raises
    ------
    InputError
        The folder has no ``limit.txt``, or no unit that reaches it.
    """
    place = folder / "limit.txt"
    if not place.is_file():
        raise InputError(f"{place}: is not there; it holds the value at which life ends")
    limit = place.read_text("utf-8").strip()
    out = []
    for path in sorted(folder.glob("*.csv")):
        history = read_value_history(path, limit)
        values = [(i.usage, i.seen[VALUE].severity or 0.0) for i in history.inspections]
        end = next((use for use, share in values if share >= 1.0), None)
        if end is not None and end > 0.0:
            before = tuple(i for i in history.inspections if i.usage < end)
            picked = np.unique(np.linspace(0, len(before) - 1, min(_MOST, len(before))).round())
            kept = tuple(before[int(k)] for k in picked)
            out.append((replace(history, inspections=kept), end))
    if not out:
        raise InputError(f"{folder}: no unit reaches the limit")
    return out


def real_rows(
    group: str, number: int, unit: tuple[ValueHistory, float], seed: int
) -> list[dict[str, Any]]:
    """Predict a real unit at shares of its life by all methods; none knows how long lives are."""
    history, end = unit
    out = []
    for share in _SHARES:
        seen = [i for i in history.inspections if i.usage <= share * end]
        if len(seen) < 2:
            continue
        known = replace(history, inspections=tuple(seen))
        since = share * end - seen[-1].usage
        life = known.life()
        answers = {OURS: remaining(value_tables(known), seen, seed) - since}
        rows = _rows(seen, life)
        for k, (name, method) in enumerate(BASELINES.items()):
            rng = np.random.default_rng([69, seed, number, k])
            answers[name] = life * method(rows, rng) - since
        out += [
            asdict(
                scored(
                    name, group, number, left, true=(1.0 - share) * end, life=end,
                    far=_FAR * life, looks=len(seen),
                )
            )
            for name, left in answers.items()
        ]  # fmt: skip
    return out


def _rows(seen: Sequence[Inspection], life: float) -> Floats:
    rows = [
        (i.usage / life, s.severity, s.low)
        for i in seen
        if (s := i.seen[VALUE]).severity is not None
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)
