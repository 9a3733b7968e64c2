"""Units without an actuator: tables written down by hand."""

import numpy as np

from elevon.prognose import Coefficient, Law, Process, ResponseTables
from elevon.prognose.requirement import Requirement
from elevon.prognose.response import Grid


def law(rate=1e-3, kind="backlash", *, power=0.0, rate_spread=0.0, **fields):
    """Growth rate x (1 + damage)^power a repetition; the closed form is in `end`."""
    fields = {"form_spread": 0.0, "highest": 4.0, "only": True, **fields}
    return Law(
        name=f"law of {kind}", text="", source="", kind=kind, place="transmission", unit="1",
        rate=lambda d, _x, c: c["rate"] * (1.0 + d) ** power, drivers=("hours",),
        coefficients={"rate": Coefficient(rate, "1", "test", rate_spread)}, **fields,
    )  # fmt: skip


def end(rate, limit, power=0.0):
    """Repetitions until damage `limit` from zero."""
    return np.log1p(limit) / rate if power == 1.0 else limit / rate


def response(*laws, limits):
    """A requirement on each severity, and a grid that says nothing else."""
    requirements = tuple(
        Requirement(name=f"{item.kind} limit", measure="severity", fault=item.key, limit=limit)
        for item, limit in zip(laws, limits, strict=True)
    )
    grid = Grid(tuple(np.array([0.0, item.highest]) for item in laws))
    count = 2 ** len(laws)
    return ResponseTables(
        laws, requirements, tuple(float(v) for v in limits), ("1",) * len(laws), grid,
        {"hours": np.ones(count)}, np.zeros((count, len(laws))), count, "low",
    )  # fmt: skip


def process(*laws, limits=(1.0,), wander=False):
    return Process(response(*laws, limits=limits), wander=wander)
