"""One kind of result: what every analysis answers with, written, read, shown and drawn alike."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from elevon.errors import FormatError, unknown
from elevon.files import read_regular, write_text
from elevon.plain import Plain, plain, units_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from elevon.report import Report, ReportTable

SCHEMA = "elevon/{}/{}"
_MOST_BYTES = 2**28  # of a result's file

#: Where each kind of result is.
_KINDS = {
    "bench": "elevon.bench.run:BenchResult",
    "calibration": "elevon.calibrate.outcome:Calibration",
    "comparison": "elevon.compare:Comparison",
    "diagnosis": "elevon.diagnose.engine.answer:Diagnosis",
    "effects": "elevon.analysis.effects:Effects",
    "examination": "elevon.doctor.answer:Examination",
    "fleet": "elevon.prognose.fleet:FleetPlan",
    "growth": "elevon.prognose.fleet_growth:FleetGrowth",
    "linear-model": "elevon.response.linear:LinearModel",
    "loop-response": "elevon.response.loop:LoopResponse",
    "monitoring": "elevon.diagnose.monitor.answer:Monitoring",
    "next-inspection": "elevon.prognose.next_inspection:NextInspection",
    "next-test": "elevon.nexttest.door:NextTest",
    "prognosis": "elevon.prognose.answer:Prognosis",
    "response": "elevon.response.estimate:FrequencyResponse",
    "validation": "elevon.calibrate.validation:Validation",
}


class Result(Plain):
    """Base of every result: a frozen dataclass with a kind, a table and a picture.

    Attributes
    ----------
    KIND, VERSION : str, int
        The schema that its JSON names: ``elevon/KIND/VERSION``.
    TABLE : str
        Attribute whose rows are the table: a sequence, or a mapping from name to row.
    COLUMNS : tuple of str
        Keys of a row that notebooks and pages show; empty: those with a single value.
    BARS : (str, str)
        Keys of a row: what each bar is called, and how long it is. Empty: no picture of this kind.
    """

    KIND: ClassVar[str]
    VERSION: ClassVar[int] = 1
    TABLE: ClassVar[str] = ""
    COLUMNS: ClassVar[tuple[str, ...]] = ()
    BARS: ClassVar[tuple[str, str]] = ("", "")

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        return f"{type(self).__name__}: {getattr(self, 'status', 'ok')}"

    def text_tables(self) -> Sequence[ReportTable]:
        """Return the tables of the answer as people read them; of texts."""
        return ()

    @property
    def remarks(self) -> Sequence[str]:
        """What else to know of the answer, the most important first."""
        return ()

    def to_dict(self, *, stored: bool = True) -> dict[str, Any]:
        """Return the JSON form, beside it its schema and the units of its keys."""
        head = {"schema": SCHEMA.format(self.KIND, self.VERSION), "units": units_of(type(self))}
        return super().to_dict(stored=stored) | head

    @classmethod
    def from_dict(cls, data: Mapping[str, object], place: str = "") -> Self:
        """Read the JSON form back.

        Raises
        ------
        FormatError
            Another schema; a key that is missing or unknown, or a value of another type.
        """
        schema = SCHEMA.format(cls.KIND, cls.VERSION)
        if data.get("schema", schema) != schema:
            raise FormatError(f"{place or cls.KIND}: schema {data['schema']!r} is not {schema!r}")
        content = {name: data[name] for name in data if name not in ("schema", "units")}
        return super().from_dict(content, place)

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Write it as JSON; `load` reads it back equal.

        Raises
        ------
        OutputExistsError
            The file is there, and not `force`.
        """
        text = json.dumps(finite(self.to_dict(), words=True), allow_nan=False, indent=1)
        return write_text(path, text + "\n", force=force)

    def table_rows(self) -> list[dict[str, Any]]:
        """Return the rows of its table as plain types, the name of a row first."""
        table = getattr(self, self.TABLE) if self.TABLE else [self]
        if isinstance(table, Mapping):
            named = [(name, plain(row, stored=False)) for name, row in table.items()]
            return [{"name": n} | (r if isinstance(r, dict) else {"value": r}) for n, r in named]
        return [plain(row, stored=False) for row in table]

    def to_pandas(self) -> pd.DataFrame:
        """Return its table, one row each; what is nested becomes columns with dots."""
        import pandas as pd

        return pd.json_normalize(self.table_rows())

    def _display(self) -> tuple[list[str], list[list[object]]]:
        rows = self.table_rows()
        single = [k for k in (rows[0] if rows else {}) if not isinstance(rows[0][k], (list, dict))]
        columns = list(self.COLUMNS or single)
        return columns, [[row.get(name) for name in columns] for row in rows]

    def _repr_html_(self) -> str:
        from elevon.report.cards import badge, card, table

        columns, rows = self._display()
        status = badge(str(getattr(self, "status", "ok")))
        return card(self.headline, [("", status)], table(columns, rows))

    def plot(self) -> Figure:
        """Return its picture: bars, unless a kind of result has one of its own.

        Raises
        ------
        FormatError
            This kind of result has none.
        """
        from elevon.report.figures import new_figure

        name, length = self.BARS
        if not name:
            raise FormatError(f"{self.KIND}: has no picture; see its report or its table")
        rows = [row for row in self.table_rows() if finite(row[length]) is not None]
        with new_figure(height=1.0 + 0.25 * len(rows)) as (figure, axis):
            axis.barh([str(row[name]) for row in rows], [float(row[length]) for row in rows])
            axis.invert_yaxis()
            axis.set(xlabel=length.replace("_", " "))
        return figure

    def report(self, *, date: str | None = None) -> Report:
        """Return its page; `Report.save` writes it as one HTML file.

        Parameters
        ----------
        date : str, optional
            Printed on the page.
        """
        from elevon.report import Report, ReportTable

        page = Report(self.KIND.capitalize(), self.headline, date=date)
        columns, rows = self._display()
        section = page.section("Result")
        if self.BARS[0]:
            section.figure(self.plot(), self.headline)
        section.table(ReportTable(columns, rows))
        return page


def finite(value: Any, *, words: bool = False) -> Any:
    """Return plain types with what JSON cannot write as null, or as a word that reads back."""
    if isinstance(value, float) and value - value != 0.0:
        return {"nan": "NaN", "inf": "Infinity"}.get(str(value), "-Infinity") if words else None
    if isinstance(value, dict):
        return {name: finite(item, words=words) for name, item in value.items()}
    if isinstance(value, list):
        return [finite(item, words=words) for item in value]
    return value


def load(path: str | os.PathLike[str]) -> Result:
    """Read a result that `Result.save` wrote.

    Raises
    ------
    FormatError
        No JSON, no schema of this package, or a content that is not of the schema.
    UnknownNameError
        A kind of result that is none.
    InputError
        The file cannot be read.
    """
    data = read_json(path)
    schema = data.get("schema")
    parts = schema.split("/") if isinstance(schema, str) else []
    if len(parts) != 3 or parts[0] != "elevon":
        raise FormatError(f"{path}: schema = {schema!r} names no result of elevon")
    if parts[1] not in _KINDS:
        raise unknown("kind of result", parts[1], _KINDS, str(path))
    module, _, name = _KINDS[parts[1]].partition(":")
    kind: type[Result] = getattr(import_module(module), name)
    return kind.from_dict(data, str(path))


def read_json(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a file that holds one JSON object.

    Raises
    ------
    FormatError
        It does not.
    InputError
        The file cannot be read.
    """
    try:
        data = json.loads(read_regular(path, _MOST_BYTES))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: is not JSON: {error}") from error
    if not isinstance(data, dict):
        raise FormatError(f"{path}: is not one JSON object")
    return data
