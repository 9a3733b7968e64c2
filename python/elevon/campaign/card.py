"""The data card of a campaign folder, in Markdown and as one page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.campaign.dataset import Dataset
from elevon.errors import ElevonError, InputError
from elevon.memory import format_bytes
from elevon.plain import fields_of
from elevon.report import Report, ReportTable, Section
from elevon.report.cells import markdown_text

if TYPE_CHECKING:
    import pyarrow as pa


_BINS = 20
#: What a description takes over from the manifest.
_STATED = (
    "name", "text", "status", "actuator", "fidelity", "version", "plan_hash", "responses", "design",
    "not_acting", "sources",
)  # fmt: skip


def describe(ds: Dataset) -> dict[str, object]:
    """Return counts, distributions and columns of a data set, in JSON's types.

    Returns
    -------
    dict
        ``name``, ``status``, ``runs``, ``bytes``, ``statuses``, ``splits``, ``cases``, ``units``,
        ``faults`` (with the runs that have each), ``varied`` (distribution of each varied
        quantity), ``clocks``, ``not_acting``, ``failed``.
    """
    table = ds.runs.to_arrow()
    status = table["status"].to_pylist()
    failed = [n for n, s in enumerate(status) if s in {"diverged", "refused"}]
    reasons = table["reason"].to_pylist()
    manifest = ds.manifest
    return {
        **fields_of(manifest, *_STATED),
        "runs": len(ds),
        "bytes": sum(about["bytes"] for item in ds.items for about in item.files.values()),
        "statuses": counted(status),
        "failed": [{"run": n, "status": status[n], "reason": reasons[n]} for n in failed[:100]],
        "splits": counted([s for s in table["split"].to_pylist() if s]),
        "cases": counted(table["case"].to_pylist()) if "case" in table.column_names else {},
        "units": len(set(table["unit"].to_pylist())),
        "seeds": len(set(table["seed"].to_pylist())),
        "blocks": len(set(table["block"].to_pylist())),
        "replicates": len(set(table["replicate"].to_pylist())),
        "healthy": _healthy_run(ds, table),
        "faults": [_typical_fault_run(item, table) for item in manifest.faults],
        "varied": [
            {**item, **distribution(table[item["name"]])}
            for item in manifest.columns
            if item["kind"] != "fault"
        ],
        "clocks": [
            {"name": c["name"], "rate": c["rate"], "columns": c["columns"]} for c in manifest.clocks
        ],
        "features": _features(ds),
    }


def counted(items: Sequence[object]) -> dict[str, int]:
    """Return how often each text occurs, in order of the first."""
    return dict(Counter(str(item) for item in items))


def distribution(column: pa.ChunkedArray) -> dict[str, object]:
    """Return smallest, largest, mean, quartiles and histogram of a column; counts of texts."""
    if not str(column.type).startswith(("double", "int")):
        return {"counts": counted([str(value) for value in column.to_pylist()])}
    values = column.to_numpy().astype(np.float64)
    return _spread_of(values)


def typical_runs(ds: Dataset, most: int = 12) -> dict[str, tuple[int, int]]:
    """Return for each fault a run of middling severity and a run to compare it with.

    Both are ``ok`` or ``tripped``; the faulty one has as few other faults as there are, the other
    one has none, or as few as there are.
    """
    names = [item["name"] for item in ds.manifest.faults][:most]
    if not names:
        return {}
    table = ds.runs.to_arrow(["status", *(item["name"] for item in ds.manifest.faults)])
    usable = np.isin(table["status"].to_pylist(), ["ok", "tripped"])
    severity = {i["name"]: np.abs(table[i["name"]].to_numpy()) for i in ds.manifest.faults}
    count = sum((values > 0.0).astype(int) for values in severity.values())
    pairs = {}
    for name in names:
        faulty = np.flatnonzero(usable & (severity[name] > 0.0))
        others = np.flatnonzero(usable & (severity[name] == 0.0))
        if len(faulty) and len(others):
            alone = faulty[count[faulty] == count[faulty].min()]
            middle = alone[np.argsort(severity[name][alone])[len(alone) // 2]]
            pairs[name] = (int(middle), int(others[np.argmin(count[others])]))
    return pairs


def _typical_fault_run(item: dict[str, Any], table: Any) -> dict[str, Any]:
    values = table[item["name"]].to_numpy()
    present = values[values != 0.0]
    return {**item, "runs": len(present), **(_spread_of(present) if len(present) else {})}


def _healthy_run(ds: Dataset, table: Any) -> int:
    faulty = np.zeros(table.num_rows, dtype=bool)
    for item in ds.manifest.faults:
        faulty |= table[item["name"]].to_numpy() != 0.0
    return int((~faulty).sum())


def _features(ds: Dataset) -> list[str]:
    try:
        return [name for name in ds.features.columns if name != "run"]
    except InputError:
        return []


def _spread_of(values: npt.NDArray[np.float64]) -> dict[str, Any]:
    low, high = float(values.min()), float(values.max())
    counts, _ = np.histogram(values, _BINS, (low, high) if high > low else (low - 0.5, low + 0.5))
    quarter, middle, third = (float(q) for q in np.quantile(values, [0.25, 0.5, 0.75]))
    return {
        "min": low,
        "max": high,
        "mean": float(values.mean()),
        "quartiles": [quarter, middle, third],
        "histogram": counts.tolist(),
    }


_FAILED_LISTED = 20


def card_texts(ds: Dataset) -> dict[str, str]:
    """Return ``README.md`` and ``card.html``."""
    about = describe(ds)
    return {"README.md": _markdown(about, ds), "card.html": _page(about, ds)}


def _first_lines(about: dict[str, Any]) -> list[str]:
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
    return [[f["name"], f["unit"], f["runs"], *_distribution_text(f)] for f in about["faults"]]


def _varied_rows(about: dict[str, Any]) -> list[list[object]]:
    return [[v["name"], v["role"], v["unit"], *_distribution_text(v)] for v in about["varied"]]


def _column_rows(about: dict[str, Any]) -> list[tuple[str, list[list[object]]]]:
    """Return each clock's folder and its columns."""
    return [
        (f"runs/{clock['name']}", [[c["name"], c["unit"], c["text"]] for c in clock["columns"]])
        for clock in about["clocks"]
    ]


def _distribution_text(item: dict[str, Any]) -> list[object]:
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
        facts=_first_lines(about),
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
        'ds = elevon.load_campaign(".")  # from within this folder, or its path\n'
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
    section = report.section("What is in it").points(_first_lines(about))
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
