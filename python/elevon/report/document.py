"""The report builder: sections of text, tables, figures and checks into one HTML file."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from elevon.files import visible, write_text
from elevon.report.checks import Check, all_passed
from elevon.report.policy import policy

if TYPE_CHECKING:
    import numpy.typing as npt
    from markupsafe import Markup
    from matplotlib.figure import Figure

_SHOWN_ROWS = 20
_LONG = 60  # characters from which a cell is set in a wide column


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table of cells.

    Attributes
    ----------
    columns : sequence of str
        Headings.
    rows : sequence of sequences
        Cells; floats are shown with `digits` significant digits, True and False as yes and no;
        `markupsafe.Markup` stands as it is.
    caption : str
        One sentence under the table.
    digits : int
        Significant digits of floats.
    marked : collection of int
        Indices of rows that are set apart by colour.
    formats : sequence of str, optional
        One format a column (such as ``+.4f``) for its numbers; an empty one means `digits`.
    folded : str
        Heading under which a table stands closed until it is opened; empty: shown, but for one of
        over twenty rows, which folds under a heading of its own.
    optional : sequence of str
        Columns that a narrow terminal leaves out, the first one first.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    caption: str = ""
    digits: int = 5
    marked: frozenset[int] = frozenset()
    formats: Sequence[str] = ()
    folded: str = ""
    optional: Sequence[str] = ()

    @classmethod
    def of(
        cls, rows: Sequence[Mapping[str, object]], caption: str = "", *, digits: int = 5
    ) -> ReportTable:
        """Return a table of rows that state their headings, all the same."""
        columns = list(rows[0]) if rows else []
        return cls(columns, [list(row.values()) for row in rows], caption, digits)

    def cell(self, value: object, column: int = 0) -> str:
        """Return the text of one cell."""
        wanted = self.formats[column] if column < len(self.formats) else ""
        if wanted and isinstance(value, (int, float)):
            return f"{value:{wanted}}".replace("-", "\N{MINUS SIGN}")
        if isinstance(value, bool):
            return "yes" if value else "no"
        if isinstance(value, float):
            return f"{value:#.{self.digits}g}".rstrip(".")
        if hasattr(value, "__html__"):  # a link, escaped by whoever made it
            return value  # type: ignore[return-value]
        return "" if value is None else str(value)

    def heading(self) -> str:
        """Return the heading under which the table stands closed; empty where it is shown.

        Over twenty rows nobody reads before opening them: such a table folds by itself.
        """
        if self.folded or len(self.rows) <= _SHOWN_ROWS:
            return self.folded
        return f"Table of {len(self.rows)} rows: {', '.join(map(str, self.columns[:4]))} ..."

    def headings(self) -> list[tuple[str, str]]:
        """Return each column's class in the page, ``number`` or none, and its heading."""
        return [("number" if self.numeric(n) else "", name) for n, name in enumerate(self.columns)]

    def body(self) -> Iterator[tuple[bool, list[tuple[str, str, str]]]]:
        """Yield whether each row is marked, and its cells: heading, class in the page, text."""
        headings = self.headings()
        for index, row in enumerate(self.rows):
            texts = [self.cell(value, column) for column, value in enumerate(row)]
            cells = [
                (name, kind or ("long" if len(text) > _LONG else ""), text)
                for (kind, name), text in zip(headings, texts, strict=True)
            ]
            yield index in self.marked, cells

    def numeric(self, column: int) -> bool:
        """Tell whether a column holds numbers only, to be set to the right."""
        cells = [row[column] for row in self.rows if row[column] is not None]
        return bool(cells) and all(
            isinstance(cell, (int, float)) and not isinstance(cell, bool) for cell in cells
        )


@dataclass(slots=True)
class Section:
    """One headed part of a report; its methods add to its end and return it."""

    title: str
    number: int
    items: list[dict[str, Any]] = field(default_factory=list)

    @property
    def anchor(self) -> str:
        """Name of the section inside the page."""
        return f"section-{self.number}"

    def text(self, *paragraphs: str) -> Section:
        """Add paragraphs of plain text (escaped: nothing in them is read as HTML)."""
        self.items += [{"kind": "text", "text": paragraph} for paragraph in paragraphs]
        return self

    def heading(self, text: str) -> Section:
        """Add a heading below the section's own."""
        self.items.append({"kind": "heading", "text": text})
        return self

    def points(self, points: Sequence[str]) -> Section:
        """Add a list of points."""
        self.items.append({"kind": "points", "points": list(points)})
        return self

    def table(self, table: ReportTable) -> Section:
        """Add a table."""
        self.items.append({"kind": "table", "table": table})
        return self

    def code(self, text: str) -> Section:
        """Add preformatted text, such as a command."""
        self.items.append({"kind": "code", "text": text})
        return self

    def checks(self, checks: Sequence[Check]) -> Section:
        """Add a table of checks with pass or fail."""
        self.items.append({"kind": "checks", "checks": list(checks)})
        return self

    def figure(self, figure: Figure, caption: str) -> Section:
        """Add a matplotlib figure: charts to zoom in and to read, an inline drawing on paper.

        Parameters
        ----------
        figure : Figure
            Best made by `elevon.report.figures.new_figure`.
        caption : str
            What it shows; also read out in place of the picture.
        """
        from elevon.report.figures import figure_markup

        name = f"{self.number}-{len(self.items)}"
        markup, live = figure_markup(figure, name, caption)
        self.items.append({"kind": "chart" if live else "figure", "markup": markup})
        return self

    def chart(
        self, title: str, time: npt.ArrayLike, lines: Mapping[str, npt.ArrayLike], **options: Any
    ) -> Section:
        """Add an interactive chart; arguments as `elevon.report.uplot.chart`."""
        from markupsafe import Markup

        from elevon.report.uplot import chart

        # Safe: the chart escapes its texts and carries its data as base64.
        self.items.append({"kind": "chart", "markup": Markup(chart(title, time, lines, **options))})  # noqa: S704
        return self

    def markup(self, markup: Markup, caption: str = "") -> Section:
        """Add trusted markup, such as an interactive plot.

        Parameters
        ----------
        markup : Markup
            `markupsafe.Markup` only: whoever builds it has escaped what it holds.
        caption : str
            One sentence under it.

        Raises
        ------
        TypeError
            A plain text was given.
        """
        if not hasattr(markup, "__html__"):
            raise TypeError("Section.markup takes markupsafe.Markup; use text() for plain text")
        self.items.append({"kind": "markup", "markup": markup, "caption": caption})
        return self


class Report:
    """A report under construction.

    Parameters
    ----------
    title : str
        Heading of the page.
    lead : str
        One or two sentences under the heading: the answer, before the details.
    date : str, optional
        Date printed on the page. Never taken from the clock: the same work gives the same bytes.
    """

    def __init__(self, title: str, lead: str = "", *, date: str | None = None) -> None:
        self.title = title
        self.lead = lead
        self.date = date
        self.sections: list[Section] = []
        self.facts: list[tuple[str, str, str]] = []
        self.opening: tuple[Markup | str, bool] = ("", False)
        self.beside: dict[str, str] = {}
        self.verdict: tuple[str, str] | None = None
        self._provenance: dict[str, str] = {}

    def judge(self, text: str, kind: Literal["pass", "fail", "open"]) -> None:
        """Set the verdict, one or two words in a badge under the title; ``open``: not decided."""
        self.verdict = (text, kind)

    def section(self, title: str, *paragraphs: str) -> Section:
        """Start a section, with its first paragraphs."""
        section = Section(title, len(self.sections) + 1)
        self.sections.append(section)
        return section.text(*paragraphs)

    def fact(self, label: str, value: str, note: str = "") -> None:
        """Add one headline number, shown in a row of them under the lead."""
        self.facts.append((label, value, note))

    def open_with(self, figure: Figure, caption: str) -> None:
        """Put one picture under the lead, before everything else."""
        from elevon.report.figures import figure_markup

        self.opening = figure_markup(figure, "opening", caption)

    def provenance(self, entries: Mapping[str, object]) -> None:
        """Add what is needed to make the report again: version, hashes, seed, command."""
        self._provenance |= {key: str(value) for key, value in entries.items()}

    @property
    def checks(self) -> list[Check]:
        """Every check of every section."""
        items = [item for section in self.sections for item in section.items]
        return [check for item in items if item["kind"] == "checks" for check in item["checks"]]

    @property
    def status(self) -> str | None:
        """`pass` or `fail` when the report holds checks, else None."""
        if not self.checks:
            return None
        return "pass" if all_passed(self.checks) else "fail"

    @property
    def tally(self) -> str:
        """How many checks pass, of how many."""
        return f"{sum(check.passed for check in self.checks)} of {len(self.checks)}"

    @property
    def folds(self) -> bool:
        """Whether a table is folded: on paper all of them are open."""
        items = [item for section in self.sections for item in section.items]
        return any(item["kind"] == "table" and item["table"].heading() for item in items)

    def html(self) -> str:
        """Return the whole page: no file, script or font is fetched from anywhere."""
        from importlib.resources import files

        import jinja2

        folder = files("elevon.report") / "templates"
        environment = jinja2.Environment(
            autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
        )
        source = (folder / "report.html.j2").read_text("utf-8")
        style = (folder / "style.css").read_text("utf-8")
        assets = self._assets()
        return environment.from_string(source).render(
            report=self,
            style=style,
            entries=self._provenance,
            assets=assets,
            policy=policy(assets, source),
        )

    def _assets(self) -> str:
        """Script and style of interactive charts, only when there are any."""
        items = [item for part in self.sections for item in part.items]
        if not any(item["kind"] == "chart" for item in items) and not self.opening[1]:
            return ""
        from elevon.report.uplot import assets

        return assets()

    def save(
        self, path: str | os.PathLike[str], *, force: bool = False, links: bool = True
    ) -> Path:
        """Write the page, whole or not at all.

        Parameters
        ----------
        path : path
            File.
        force : bool
            Whether an existing file may be replaced.
        links : bool
            Whether it links to the reports that stand beside it: not where work writes several
            pages, and an older one of them may stand there.

        Raises
        ------
        OutputExistsError, OutputError
            As `elevon.files.write_text`.
        """
        self.beside = _pages_beside(Path(path).expanduser()) if links else {}
        return write_text(path, self.html(), force=force)


def provenance(command: str, **more: object) -> dict[str, object]:
    """Return what a page says of its making: versions, the command that makes it again.

    Parameters
    ----------
    command : str
        Command line that makes the page again.
    **more
        What else is stated, such as the seed.
    """
    import elevon

    try:
        version = elevon.__version__
    except ImportError:
        version = "source tree without the compiled core"
    python = ".".join(str(number) for number in sys.version_info[:3])
    return {"Elevon": version, "Python": python, "Made again by": command, **more}


_MARK = '<meta name="generator" content="Elevon">'
_HEAD = 4096  # bytes of a page in which its mark and its title stand


def _pages_beside(path: Path) -> dict[str, str]:
    """Return the other reports of a page's folder: file name to title, for the page to link to."""
    pages = {}
    for other in visible(path.parent, "*.html"):
        if other.name == path.name:
            continue
        with suppress(OSError), other.open(encoding="utf-8", errors="replace") as stream:
            head = stream.read(_HEAD)
            title = re.search(r"<title>(.*?)</title>", head, re.S)
            if _MARK in head and title:
                pages[other.name] = unescape(title[1])
    return pages
