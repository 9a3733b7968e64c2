"""What the published works print, item by item, and which case recomputes it.

``works/NAME.toml`` lists every table and figure of one work; ``cases.toml`` has one record a case:
what it covers, and what each of its checks is held against.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cache
from typing import Any

from elevon.data import packaged_toml
from elevon.errors import InputError, unknown

SELF_CONSISTENCY = "self_consistency"
KINDS: Mapping[str, str] = {
    "source": "numbers and statements that the works print",
    "closed_form": "closed forms",
    "independent": "another program",
    "real_log": "logs of real machines",
    SELF_CONSISTENCY: "ourselves: our own truth, or a limit of ours",
}
"""What a check is held against; the kinds are never counted together."""


@dataclass(frozen=True, slots=True)
class Judgement:
    """What the checks of one kind are held against.

    Attributes
    ----------
    check : str
        Their name; ``*`` stands for what differs between rows.
    kind : str
        One of `KINDS`.
    basis : str
        Of a source the place in the work, with the page where its lists state one; the closed form,
        the program, the data set. Empty of self-consistency.
    item : str
        Work and table or figure, such as ``torino-paper Table 2``.
    theirs : str
        What is printed, as printed; empty where the work prints no number for it, and of
        self-consistency: there no number of a work stands beside a verdict.
    definition : str
        What the value is, and where the limit comes from.
    known : str
        Why it fails, where that is known.
    """

    check: str
    kind: str
    item: str
    theirs: str
    definition: str
    known: str = ""
    basis: str = ""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise unknown("kind of check", self.kind, KINDS, f"check '{self.check}'")
        apart = self.kind == SELF_CONSISTENCY
        if apart == bool(self.basis) or (apart and self.theirs):
            needs = "neither 'basis' nor 'theirs'" if apart else "a 'basis'"
            raise InputError(f"check '{self.check}': kind {self.kind} takes {needs}")

    def judges(self, name: str) -> bool:
        """Whether a check of this name is one of them."""
        return fnmatchcase(name, self.check)


@dataclass(frozen=True, slots=True)
class Published:
    """What one case recomputes.

    Attributes
    ----------
    name : str
        The case's command.
    covers : mapping of str to tuple of str
        Work to its tables and figures that the case makes.
    checks : tuple of Judgement
        One for each kind of check.
    options : mapping
        Options with which `--all` runs it, where they are not the command's own.
    seconds : float
        About how long it takes: for the progress only.
    needs : str
        The option without which it is not run; empty: none.
    """

    name: str
    covers: Mapping[str, tuple[str, ...]]
    checks: tuple[Judgement, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = 5.0
    needs: str = ""

    def judgement(self, name: str) -> Judgement:
        """Return what a check of this name is held against; ours alone where none is stated."""
        found = (judged for judged in self.checks if judged.judges(name))
        return next(found, Judgement(name, SELF_CONSISTENCY, " ", "", ""))


@dataclass(frozen=True, slots=True)
class PrintedItem:
    """One table or figure of a work.

    Attributes
    ----------
    name, text : str
        Its number in the work; what it shows.
    cases : tuple of str
        Cases that make it.
    command : str
        Another command that does; empty: none.
    why : str
        Why none does, or what differs; empty where one does.
    """

    name: str
    text: str
    cases: tuple[str, ...]
    command: str = ""
    why: str = ""

    @property
    def compared(self) -> bool:
        """Whether a check holds something of ours against what is printed or known otherwise."""
        judged = (check for case in self.cases for check in published()[case].checks)
        return any(
            check.kind != SELF_CONSISTENCY and check.item.endswith(f" {self.name}")
            for check in judged
        )

    @property
    def commands(self) -> tuple[str, ...]:
        """Every command that makes it."""
        cases = tuple(_command(published()[case]) for case in self.cases)
        return (*cases, self.command) if self.command else cases


@dataclass(frozen=True, slots=True)
class PublishedWork:
    """One work: its title, and everything that it prints as a table or a figure."""

    name: str
    title: str
    items: tuple[PrintedItem, ...]


def _command(record: Published) -> str:
    needs = f" {record.needs} FOLDER" if record.needs else ""
    return f"elevon reproduce {record.name}{needs}"


@cache
def published() -> Mapping[str, Published]:
    """Return the record of each case, by name."""
    return {
        name: _record(name, entry) for name, entry in packaged_toml(__name__, "cases.toml").items()
    }


@cache
def works() -> tuple[PublishedWork, ...]:
    """Return every work with its tables and figures, each with the cases that cover it."""
    names = ("torino-paper", "torino-bench", "torino-transmission", "nasa", "pisa", "cranfield",
             "real-machines")  # fmt: skip
    return tuple(_work(name, packaged_toml(__name__, f"works/{name}.toml")) for name in names)


def _record(name: str, entry: Mapping[str, Any]) -> Published:
    other = {key: entry[key] for key in entry if key not in ("covers", "checks")}
    covers = {work: _expanded(items) for work, items in entry["covers"].items()}
    return Published(name, covers, tuple(Judgement(**item) for item in entry["checks"]), **other)


def _work(name: str, entry: Mapping[str, Any]) -> PublishedWork:
    covered = {
        record.name: frozenset(record.covers.get(name, ())) for record in published().values()
    }
    items = []
    for item in entry["items"]:
        for number in _expanded([item["name"]]):
            cases = tuple(case for case, names in covered.items() if number in names)
            items.append(PrintedItem(number, item["text"], cases, item.get("command", ""),
                                     item.get("why", "")))  # fmt: skip
    return PublishedWork(name, entry["title"], tuple(items))


def _expanded(items: Sequence[str]) -> tuple[str, ...]:
    """Return single items: ``Figure 3.5 to 3.8`` is four of them."""
    names: list[str] = []
    for item in items:
        first, _, last = item.partition(" to ")
        if not last:
            names.append(first)
            continue
        stem, start = _split(first)
        end = int(last.rpartition(".")[2])
        names += [f"{stem}{number}" for number in range(start, end + 1)]
    return tuple(names)


def _split(name: str) -> tuple[str, int]:
    """Return a name without its last number, and that number."""
    digits = len(name) - len(name.rstrip("0123456789"))
    return name[:-digits], int(name[-digits:])
