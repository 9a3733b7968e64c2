"""Which column has which role: all candidates scored together, by the data before the names.

A position is the integral of its speed, the two shafts move in one ratio, what follows a command is
of its size and later, and acceleration, direction and speed explain a current. Each of these is a
term of one score, headers are another, smaller one, and a unit that a role cannot have excludes it.
The assignment of the highest score is taken; how far the next best one with another column in a
role lies below is that role's margin.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from elevon.arrays import Floats
from elevon.estimate.signals import integral
from elevon.logs.maps.agreement import slope_and_fit

#: Margin below which a role is asked for. ASSUMED: a header that says a role counts 0.7, so that
#: only what neither data nor headers settle is doubtful.
DOUBTFUL = 0.5
_NAMED = 0.7  # a header that suggests the role; less it where it suggests another
_EXACT = 6.0  # the role's own name as header
_FILLED = -0.05  # a role that is filled: without a relation or a header it stays empty
_SAMPLES = 4000  # that are compared
_CLOSE = 3.0  # most that one relation counts: a residual of 1e-3 of the power
_LONGEST = 1.0  # s: latest that an output follows its command
_SIZE = 2.0  # a servo follows its command within this factor
_FAST = 1.5  # the motor turns farther than the output, at least
_MOST = 4  # columns that are tried in a role
_EXPLAINS = 0.9  # share of a column that a relation must explain to speak for it

#: Roles and the kinds of quantity that they can be; an empty kind is a column without a unit.
KINDS: Mapping[str, frozenset[str]] = {
    "command": frozenset({"angle", "length", "counts", ""}),
    "output_position": frozenset({"angle", "length", "counts", ""}),
    "motor_position": frozenset({"angle", "counts", ""}),
    "motor_speed": frozenset({"turning", ""}),
    "speed_ref": frozenset({"turning", ""}),
    "output_speed": frozenset({"turning", "sliding", ""}),
}


@dataclass(frozen=True)
class Candidate:
    """A column that may have one of the roles of `KINDS`.

    Attributes
    ----------
    name : str
        Of the column.
    kind : str
        ``angle``, ``length``, ``turning``, ``sliding``, ``counts``; empty without a unit.
    scale : float
        SI per unit of the file; 1 where it is not known.
    values : ndarray, shape (n,)
        Without holes.
    hint : str
        Role that the header suggests; empty for none.
    exact : bool
        Whether the header is the role's own name.
    """

    name: str
    kind: str
    scale: float
    values: Floats
    hint: str = ""
    exact: bool = False


@dataclass(frozen=True)
class Joint:
    """The best assignment.

    Attributes
    ----------
    roles : dict of str to str
        Role to column.
    margins : dict of str to float
        Of each of them.
    others : dict of str to list of str
        Columns that would do nearly as well, by role; empty text: none of them.
    reasons : dict of str to str
        What the data show, by role.
    """

    roles: dict[str, str] = field(default_factory=dict)
    margins: dict[str, float] = field(default_factory=dict)
    others: dict[str, list[str]] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)


def assign_roles(
    time: Floats, columns: Sequence[Candidate], currents: Mapping[str, Floats]
) -> Joint:
    """Assign the roles of motion to columns.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    columns : sequence of Candidate
        Those that vary.
    currents : mapping of str to ndarray, shape (n,)
        Columns that may be a current, those without a unit among them.
    """
    terms = _Terms(time, columns, currents)
    tried = {role: terms.tried(role) for role in KINDS}
    scored: list[tuple[float, tuple[int, ...]]] = []
    for chosen in product(*(tried[role] for role in KINDS)):
        placed = [k for k in chosen if k >= 0]
        if len(set(placed)) == len(placed) and placed:
            scored.append((terms.score(dict(zip(KINDS, chosen, strict=True))), chosen))
    if not scored:
        return Joint()
    best, chosen = max(scored, key=lambda item: (item[0], item[1]))
    joint = Joint()
    for place, role in enumerate(KINDS):
        k = chosen[place]
        if k < 0:
            continue
        rivals: dict[int, float] = {}
        for score, other in scored:
            if other[place] != k:
                rivals[other[place]] = max(rivals.get(other[place], -np.inf), score)
        joint.roles[role] = columns[k].name
        joint.margins[role] = best - max(rivals.values(), default=-np.inf)
        near = sorted((best - s, j) for j, s in rivals.items() if best - s < DOUBTFUL)
        joint.others[role] = [columns[j].name if j >= 0 else "" for _, j in near]
        joint.reasons[role] = terms.reason(role, dict(zip(KINDS, chosen, strict=True)))
    return joint


class _Terms:
    """Terms of the score, each worked out once."""

    def __init__(
        self, time: Floats, columns: Sequence[Candidate], currents: Mapping[str, Floats]
    ) -> None:
        self.columns, self.time, self.currents = columns, time, currents
        stride = max(1, len(time) // _SAMPLES)
        self.stride = stride
        step = float(np.median(np.diff(time)))
        most = max(2, min(int(_LONGEST / step), len(time) // 4))
        self.lags = np.unique(np.geomspace(1, most, 24).astype(int))
        self.whole = [c.values * c.scale for c in columns]
        self.values = [c.values[::stride] * c.scale for c in columns]
        self.turned = [
            integral(time, c.values * c.scale)[::stride] if c.kind in {"turning", "sliding", ""}
            else None
            for c in columns
        ]  # fmt: skip
        self._known: dict[tuple[str, int, int], float] = {}

    def tried(self, role: str) -> list[int]:
        """Return the columns to try in a role, none of them last."""
        allowed = [k for k, c in enumerate(self.columns) if c.kind in KINDS[role]]
        if role in {"output_speed", "speed_ref", "motor_position"}:  # rarely without a unit
            named = [k for k in allowed if self.columns[k].kind or self.columns[k].hint == role]
            allowed = named or [k for k in allowed if not self.columns[k].hint]
        return [*sorted(allowed, key=lambda k: -self.named(role, k))[:_MOST], -1]

    def named(self, role: str, k: int) -> float:
        """What the header says of a role."""
        column = self.columns[k]
        if not column.hint:
            return 0.0
        return (_EXACT if column.exact else _NAMED) * (1.0 if column.hint == role else -1.0)

    def score(self, at: Mapping[str, int]) -> float:
        """Return the score of an assignment: role to column, -1 for none."""
        total = sum(_FILLED + self.named(role, k) for role, k in at.items() if k >= 0)
        motor, output = at["motor_position"], at["output_position"]
        speed, slow = at["motor_speed"], at["output_speed"]
        for ref, follower in (("command", output), ("speed_ref", speed)):
            if at[ref] >= 0:
                total += self.follows(at[ref], follower) if follower >= 0 else -_CLOSE
        for position, rate in ((motor, speed), (output, slow)):
            if position >= 0 and rate >= 0:
                total += self.integral(position, rate, same_shaft=True)
        if motor < 0 and output >= 0 and speed >= 0:
            total += self.integral(output, speed, same_shaft=False)
        if motor >= 0 and output >= 0:
            total += self.ratio(motor, output)
        placed = {self.columns[k].name for k in at.values() if k >= 0}
        if max(output, motor) >= 0:
            total += self.driven(output if output >= 0 else motor, 2, placed)
        elif speed >= 0:
            total += self.driven(speed, 1, placed)
        if slow >= 0 and output < 0:
            total -= _CLOSE
        if slow >= 0 and speed >= 0 and motor < 0 and not self._stated(speed, "motor_speed"):
            total -= _CLOSE  # one position has one speed, unless something says that it has two
        if output < 0 and motor >= 0 and at["command"] >= 0:
            total -= _NAMED
        return total

    def driven(self, k: int, order: int, placed: Collection[str]) -> float:
        """How well acceleration, direction and speed explain a current (`order`: derivatives)."""
        best = 0.0
        for name, current in self.currents.items():
            if name in placed:
                continue
            key = (f"{order}:{name}", k, k)
            if key not in self._known:
                moved = self.whole[k]
                rate = np.gradient(moved, self.time) if order == 2 else moved
                rate = _smoothed(rate)
                size = float(np.std(rate)) or 1.0
                parts = (np.gradient(rate, self.time), np.tanh(10.0 * rate / size), rate)
                design = np.column_stack((*parts, np.ones(len(rate))))[:: self.stride]
                y = current[:: self.stride]
                fit = design @ np.linalg.lstsq(design, y, rcond=None)[0]
                left = 1.0 - slope_and_fit(fit, y)[1]
                self._known[key] = float(np.clip(np.log10(0.5 / max(left, 1e-9)), 0.0, 2.0))
            best = max(best, self._known[key])
        return best

    def _stated(self, k: int, role: str) -> bool:
        """Whether unit or header of a column speak for a role."""
        return bool(self.columns[k].kind) or self.columns[k].hint == role

    def integral(self, position: int, rate: int, *, same_shaft: bool) -> float:
        """How well a position is the integral of a speed; on one shaft also in size."""
        key = ("same" if same_shaft else "geared", position, rate)
        if key not in self._known:
            turned = self.turned[rate]
            slope, explained = (0.0, 0.0)
            if turned is not None and position != rate:
                slope, explained = slope_and_fit(turned, self.values[position])
            score = _closeness(explained)
            stated = self.columns[position].kind and self.columns[rate].kind
            if same_shaft and stated and not 0.85 < abs(slope) < 1.18:
                score = -_CLOSE
            self._known[key] = score
        return self._known[key]

    def ratio(self, motor: int, output: int) -> float:
        """How well two positions move together, the motor's the farther."""
        key = ("ratio", motor, output)
        if key not in self._known:
            slope, explained = slope_and_fit(self.values[motor], self.values[output])
            a, b = self.columns[motor].kind, self.columns[output].kind
            size = abs(slope) if a == b else 0.0
            farther = size * _FAST < 1.0 or (not (a and b) and size > _FAST)
            self._known[key] = _closeness(explained) if farther else -_CLOSE
        return self._known[key]

    def follows(self, ahead: int, behind: int) -> float:
        """How well a signal follows another: of its size, and later."""
        key = ("follows", ahead, behind)
        if key not in self._known:
            first, second = self.columns[ahead], self.columns[behind]
            if first.kind and second.kind and first.kind != second.kind:
                return -_CLOSE
            x, y = self.values[ahead], self.values[behind]
            later = max(self._shifted(ahead, behind, int(k)) for k in self.lags)
            now = slope_and_fit(x, y)[1]
            sooner = max(self._shifted(behind, ahead, int(k)) for k in self.lags)
            slope = slope_and_fit(x, y)[0]
            if not (first.kind and second.kind):  # what states no unit has the other's
                slope *= first.scale / second.scale
            score = _closeness(max(later, now, sooner))
            if not 1.0 / _SIZE < slope < _SIZE:
                score = -_CLOSE
            lead = np.log10((1.0 - max(sooner, now) + 1e-9) / (1.0 - max(later, now) + 1e-9))
            self._known[key] = score + float(np.clip(2.0 * lead, -2.0, 2.0))
        return self._known[key]

    def _shifted(self, ahead: int, behind: int, lag: int) -> float:
        """Share of one signal that another explains some samples earlier."""
        x, y = self.whole[ahead][:-lag], self.whole[behind][lag:]
        return slope_and_fit(x[:: self.stride], y[:: self.stride])[1]

    def reason(self, role: str, at: Mapping[str, int]) -> str:
        """Return what speaks for a role, in words."""
        k = at[role]
        reasons = ["its header suggests it"] if self.named(role, k) > 0.0 else []
        pairs = {
            "command": ("output_position", "follows it"),
            "speed_ref": ("motor_speed", "follows it"),
            "motor_speed": ("motor_position" if at["motor_position"] >= 0 else "output_position",
                            "is its integral"),
            "output_speed": ("output_position", "is its integral"),
            "motor_position": ("output_position", "moves with it, over the ratio"),
        }  # fmt: skip
        other, text = pairs.get(role, ("", ""))
        if other and at[other] >= 0 and self._known:
            reasons.append(f"{self.columns[at[other]].name!r} {text}")
        return "; ".join(reasons) or "the one column that is left for it"


def lead(time: Floats, x: Floats, y: Floats) -> float:
    """Return by how much better a signal explains another later than sooner; below 0: it follows.

    Twice the tens logarithm of what is left, at most 2 in size, as the term of a command.
    """
    pair = [Candidate("x", "", 1.0, x), Candidate("y", "", 1.0, y)]
    terms = _Terms(time, pair, {})
    return float(np.clip((terms.follows(0, 1) - terms.follows(1, 0)) / 2.0, -2.0, 2.0))


def _smoothed(values: Floats) -> Floats:
    return np.convolve(np.pad(values, 4, mode="edge"), np.full(9, 1.0 / 9.0), mode="valid")


def _closeness(explained: float) -> float:
    """Return a relation's term: 0 at 90 % explained, 1 at 99 %, 2 at 99.9 %."""
    return float(np.clip(np.log10((1.0 - _EXPLAINS) / max(1.0 - explained, 1e-9)), -2.0, _CLOSE))


def drives_of(names: Sequence[str]) -> list[str]:
    """Return the drives whose columns stand side by side: ``a1`` and ``a2`` of ``a1 position``...

    A first word that ends in a number names a drive where another one has two of its columns too.
    """
    parts = [re.match(r"([A-Za-z]+[_ ]?\d+)[ _.:/-]+(.+)", name) for name in names]
    groups: dict[str, set[str]] = {}
    for match in parts:
        if match:
            groups.setdefault(match[1], set()).add(match[2].lower())
    return [
        name
        for name, tails in groups.items()
        if any(other != name and len(tails & groups[other]) >= 2 for other in groups)
    ]
