"""The data card of a campaign folder, in Markdown and as one page."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from elevon.campaign.dataset import Dataset
from elevon.campaign.describe import describe, typical_runs
from elevon.errors import ElevonError
from elevon.memory import format_bytes
from elevon.report import Report, ReportTable, Section
from elevon.report.cells import markdown_text

_FAILED_LISTED = 20


def card_texts(ds: Dataset) -> dict[str, str]:
    """Return ``README.md`` and ``card.html``."""
    about = describe(ds)
    return {"README.md": _markdown(about, ds), "card.html": _page(about, ds)}


def _facts(about: dict[str, Any]) -> list[str]:
    """Return the card's first lines."""
    facts = [
        f"Simulated with elevon {about['version']}: {about['actuator']}, {about['fidelity']} "
        "fidelity.",
        f"{about['runs']} runs ({_counts(about['statuses'])}), {format_bytes(about['bytes'])}.",
    ]
    if about["faults"]:
        facts.append(f"{about['healthy']} runs have no fault at all.")
    if about["splits"]:
        facts.append(f"Parts: {_counts(about['splits'])}; no unit and no draw stands in two.")
    if about["cases"]:
        facts.append(f"Cases: {_counts(about['cases'])}.")
    if about["design"]:
        facts.append(f"Design: {_design(about['design'])}.")
    if about["responses"]:
        facts.append(f"Responses: {', '.join(about['responses'])}.")
    return facts


def _design(design: dict[str, Any]) -> str:
    words = str(design["kind"]).replace("_", " ")
    if "resolution" in design:
        words += f" of resolution {design['resolution']}"
    if design.get("generators"):
        words += f", generators {', '.join(design['generators'])}"
    extra = [f"{design[key]} {key}" for key in ("replicates", "blocks") if design.get(key, 1) > 1]
    return ", ".join([words, *extra])


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in counts.items())


_FAULT_TITLES = ("fault", "unit", "runs", "smallest", "median", "largest", "distribution")
_VARIED_TITLES = ("quantity", "role", "unit", "smallest", "median", "largest", "distribution")
_COLUMN_TITLES = ("column", "unit", "text")
_BARS = " ▁▂▃▄▅▆▇█"


def _fault_rows(about: dict[str, Any]) -> list[list[object]]:
    return [[f["name"], f["unit"], f["runs"], *_shape(f)] for f in about["faults"]]


def _varied_rows(about: dict[str, Any]) -> list[list[object]]:
    return [[v["name"], v["role"], v["unit"], *_shape(v)] for v in about["varied"]]


def _column_rows(about: dict[str, Any]) -> list[tuple[str, list[list[object]]]]:
    """Return each clock's folder and its columns."""
    return [
        (f"runs/{clock['name']}", [[c["name"], c["unit"], c["text"]] for c in clock["columns"]])
        for clock in about["clocks"]
    ]


def _shape(item: dict[str, Any]) -> list[object]:
    """Return smallest, median and largest value, and the histogram as a line of bars."""
    if "counts" in item:
        return ["", "", "", _counts(dict(list(item["counts"].items())[:6]))]
    if "histogram" not in item:
        return ["", "", "", ""]
    most = max(item["histogram"])
    bars = "".join(_BARS[-(-8 * count // most)] for count in item["histogram"])
    return [item["min"], item["quartiles"][1], item["max"], bars]


def _markdown(about: dict[str, Any], ds: Dataset) -> str:
    import jinja2

    # Every text of somebody else goes through `markdown_text`.
    environment = jinja2.Environment(  # noqa: S701
        trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters |= {"md": markdown_text, "cell": _cell}
    source = (files("elevon.campaign") / "card.md.j2").read_text("utf-8")
    text = environment.from_string(source).render(
        about=about,
        facts=_facts(about),
        code=_code(ds),
        clocks=ds.clocks,
        failed=_failed(about),
        tables=[
            ("Faults", _FAULT_TITLES, _fault_rows(about)),
            ("Varied quantities", _VARIED_TITLES, _varied_rows(about)),
        ],
        columns=[
            (f"Columns of `{name}`", _COLUMN_TITLES, rows) for name, rows in _column_rows(about)
        ],
    )
    return text.rstrip() + "\n"


def _cell(cell: object) -> str:
    return markdown_text(f"{cell:.5g}" if isinstance(cell, float) else str(cell))


def _code(ds: Dataset) -> str:
    return (
        "import elevon\n\n"
        f"ds = elevon.load_campaign({json.dumps(ds.folder.name)})\n"
        "runs = ds.runs.to_pandas()       # one row a run: faults in SI, 0 when absent\n"
        + (
            "signals = ds.signals.to_pandas(runs=[0])"
            if ds.clocks
            else "features = ds.features.to_pandas()"
        )
    )


def _failed(about: dict[str, Any]) -> list[str]:
    lines = [
        f"run {f['run']}: {f['status']}: {markdown_text(f['reason'])}"
        for f in about["failed"][:_FAILED_LISTED]
    ]
    more = len(about["failed"]) > len(lines)
    return [*lines, "and more: see `status` and `reason` in `runs.parquet`"][: len(lines) + more]


def _page(about: dict[str, Any], ds: Dataset) -> str:
    report = Report(about["name"], about["text"] or "Simulated runs of one actuator.")
    report.fact("runs", str(about["runs"]), _counts(about["statuses"]))
    report.fact("size", format_bytes(about["bytes"]))
    section = report.section("What is in it").points(_facts(about))
    section.code(_code(ds))
    if about["faults"]:
        table = ReportTable(
            _FAULT_TITLES, _fault_rows(about), "Severities of the runs that have it."
        )
        report.section("Faults").table(table)
    if about["varied"]:
        report.section("Varied quantities").table(ReportTable(_VARIED_TITLES, _varied_rows(about)))
    if about["not_acting"]:
        report.section("Set, but without effect").points(about["not_acting"])
    if about["failed"]:
        report.section("Runs that failed").points([f"* {line}" for line in _failed(about)])
    if ds.clocks:
        _pictures(report.section("Typical signals"), ds)
    for name, rows in _column_rows(about):
        report.section(f"Columns of {name}").table(ReportTable(_COLUMN_TITLES, rows, folded=name))
    keys = ("version", "plan_hash", "actuator", "fidelity")
    report.provenance({key: about[key] for key in keys} | about["sources"])
    return report.html()


def _pictures(section: Section, ds: Dataset) -> None:
    """Add the responses (or first signals) of a typical run of each fault, and of one without."""
    pairs = typical_runs(ds)
    columns = _curve_columns(ds)
    if not pairs:
        _curves(section, ds, {"run 0": 0}, columns, "run 0")
    for name, (faulty, other) in pairs.items():
        labels = {f"run {faulty}, {name}": faulty, f"run {other}, without": other}
        _curves(section, ds, labels, columns, name)


def _curve_columns(ds: Dataset) -> list[dict[str, str]]:
    """Return the columns that are drawn: the responses, else the first three signals."""
    faults = {item["name"] for item in ds.manifest.faults}
    columns = [
        column
        for column in ds.manifest.clocks[0]["columns"]
        if column["name"] not in {"run", "time", *faults}
    ]
    responses = [column for column in columns if column["name"] in ds.manifest.responses]
    return (responses or columns)[:3]


def _curves(
    section: Section,
    ds: Dataset,
    runs: dict[str, int],
    columns: Sequence[dict[str, str]],
    title: str,
) -> None:
    import numpy as np

    try:
        table = ds.signals.to_arrow(
            ["run", "time", *(column["name"] for column in columns)], runs.values()
        )
    except ElevonError as error:
        section.text(f"{title}: {error}")
        return
    number = table["run"].to_numpy()
    masks = {label: number == run for label, run in runs.items()}
    longest = max(masks.values(), key=np.count_nonzero)
    time = table["time"].to_numpy()[longest]
    if len(time) < 2:
        return
    for column in columns:
        values = table[column["name"]].to_numpy()
        lines = {
            label: np.interp(time, table["time"].to_numpy()[mask], values[mask], right=np.nan)
            for label, mask in masks.items()
            if mask.any()
        }
        section.chart(f"{title}: {column['name']}", time, lines, y_label=column["unit"])
