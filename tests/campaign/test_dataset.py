"""The data set: tables for every tool, labels to trust, verified, exported, split anew."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

import elevon
from elevon.campaign.card import describe
from elevon.campaign.export import identifiers, run_numbers
from elevon.cli import main
from elevon.errors import InputError

HEAD = 'runs_per_file = 4\nrecord = "output_position,motor_speed@400 Hz"'
TAIL = """
[[case]]
name = "healthy"
[[case]]
name = "rubbing"
faults = ["friction@transmission=0.2:ramp(start=0 s,end=5 ms)"]
[[vary]]
fault = "backlash@transmission"
values = ["0 deg", "0.1 deg"]
[[vary]]
parameter = "control.mode"
values = ["position"]
[split]
train = 0.5
test = 0.5
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A campaign of 12 runs in 3 files, two of its three axes faults."""
    from tests.campaign.conftest import PLAN, VARY

    folder = tmp_path_factory.mktemp("made")
    text = PLAN.format(vary=VARY.format(count=3), head=HEAD, tail=TAIL, terms="")
    (folder / "plan.toml").write_text(text)
    assert main(["campaign", "run", str(folder / "plan.toml"), "--out", str(folder / "set")]) == 0
    return folder / "set"


@pytest.fixture
def copied(made, tmp_path):
    shutil.copytree(made, tmp_path / "set")
    return tmp_path / "set"


def alone_of(made, number):
    """Simulate one run of the set by itself."""
    resolved = elevon.load_campaign(made).resolved()
    run = resolved.run(number)
    return elevon.simulate(
        run.actuator,
        run.scenario,
        fidelity=resolved.fidelity,
        record=resolved.record,
        seed=run.seed,
        number=number,
    )


def test_labels_are_columns_by_the_faults_names(made):
    ds = elevon.load_campaign(made)
    runs = ds.runs.to_pandas()
    assert runs["backlash@transmission"].tolist() == pytest.approx([0.0, np.radians(0.1)] * 6)
    assert runs["friction@transmission"].tolist() == [0.0] * 6 + [0.2] * 6
    assert ds.runs.units["backlash@transmission"] == "rad"
    assert runs.case.tolist() == ["healthy"] * 6 + ["rubbing"] * 6
    assert runs["control.mode"].tolist() == ["position"] * 12
    samples = ds.signals.to_pandas()
    assert (
        samples.groupby("run")["backlash@transmission"].first() == runs["backlash@transmission"]
    ).all()
    growing = samples[samples.run == 7]["friction@transmission"].to_numpy()
    assert (growing == alone_of(made, 7)["fault_1"].values).all()
    assert 0.0 < growing[1] < growing[2] == 0.2
    assert (samples[samples.run < 6]["friction@transmission"] == 0.0).all()
    assert not samples.isna().any().any()


def test_every_tool_opens_it_in_one_line(made):
    import duckdb
    import pandas as pd
    import polars as pl
    import xarray as xr

    ds = elevon.load_campaign(made)
    frame = ds.signals.to_pandas()
    assert len(pd.read_parquet(made / "runs.parquet")) == 12
    assert pl.scan_parquet(ds.signals.path).collect().height == len(frame)
    assert ds.signals.to_polars().select("run").unique().collect().height == 12
    assert duckdb.sql(f"select count(distinct run) from '{ds.signals.path}'").fetchall() == [(12,)]
    assert ds.runs.to_duckdb().aggregate("max(run)").fetchall() == [(11,)]
    cube = ds.signals.to_xarray(["motor_speed"])
    assert isinstance(cube, xr.Dataset)
    assert dict(cube.sizes) == {"run": 12, "time": 5}
    assert cube.motor_speed.attrs["units"] == "rad/s"
    one = ds.signals.to_pandas(["run", "motor_speed"], runs=[5])
    assert set(one.run) == {5}
    assert (cube.motor_speed.sel(run=5).to_numpy() == one.motor_speed.to_numpy()).all()


def test_reading_asks_for_names_that_are_there(made):
    ds = elevon.load_campaign(made)
    with pytest.raises(InputError, match="did you mean 'motor_speed'"):
        ds.signals.to_pandas(["motor_sped"])
    with pytest.raises(InputError, match="holds no features"):
        _ = ds.features
    with pytest.raises(InputError, match="unknown clock"):
        ds.clock("every")
    with pytest.raises(InputError, match="is not a campaign folder"):
        elevon.load_campaign(made.parent)


def test_opening_reads_the_manifest_only(made, monkeypatch):
    import pyarrow.parquet

    def never(*_, **__):
        raise AssertionError

    monkeypatch.setattr(pyarrow.parquet, "read_table", never)
    monkeypatch.setattr(pyarrow.parquet, "ParquetFile", never)
    ds = elevon.load_campaign(made)
    assert len(ds) == 12
    assert len(ds.signals.files) == 3


def test_a_whole_set_verifies(made, cli):
    code, report, _ = cli("dataset", "verify", made)
    assert (code, report["status"]) == (0, "pass")
    assert all(check["passed"] for check in report["checks"])


def _flip(path, place=None):
    data = bytearray(path.read_bytes())
    data[len(data) // 2 if place is None else place] ^= 4
    path.write_bytes(data)


def _other_split(folder):
    """Put one run of a draw into the other part, with every checksum right."""
    from elevon.campaign import read_manifest, read_resolved
    from elevon.campaign.block import write_table
    from elevon.campaign.resolved_file import plan_hash, read_outcome, runs_table
    from elevon.worklog import digest

    resolved, manifest = read_resolved(folder), read_manifest(folder)
    draw, split = resolved.index.draw.copy(), resolved.index.split.copy()
    draw[1], split[:2] = draw[0], ["train", "test"]
    resolved.index = replace(resolved.index, draw=draw, split=split)
    table = runs_table(resolved, read_outcome(folder / "runs.parquet"))
    write_table(table, folder / "runs.parquet")
    manifest.plan_hash = plan_hash(resolved)
    manifest.files["runs.parquet"] = digest(folder / "runs.parquet")
    manifest.write(folder)


DAMAGE = {
    "a bit of a block": (
        lambda d: _flip(d / "runs/at_400_hz/block_00001.parquet"),
        "not as they were written",
    ),
    "a block": (lambda d: (d / "runs/at_400_hz/block_00002.parquet").unlink(), "missing"),
    "a bit of the table": (lambda d: _flip(d / "runs.parquet"), "not as they were written"),
    "a bit of the plan": (lambda d: _flip(d / "resolved.json"), "resolved plan"),
    "a bit of the manifest": (lambda d: _flip(d / "manifest.json"), "manifest"),
    "a file too many": (
        lambda d: shutil.copy(
            d / "runs/at_400_hz/block_00000.parquet", d / "runs/at_400_hz/block_00009.parquet"
        ),
        "manifest does not list",
    ),
    "a leak": (_other_split, "in more than one part"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_found(copied, cli, name):
    damage, message = DAMAGE[name]
    damage(copied)
    code, report, _ = cli("dataset", "verify", copied)
    assert (code, report["status"]) == (1, "fail")
    assert any(message in check["name"] for check in report["checks"] if not check["passed"])


def test_verifying_something_else_is_bad_input(tmp_path, cli):
    code, report, err = cli("dataset", "verify", tmp_path)
    assert (code, report) == (2, None)
    assert "is not a campaign folder" in err


def test_describe(made, cli):
    code, report, _ = cli("dataset", "describe", made)
    assert code == 0
    assert report["statuses"] == {"ok": 12}
    assert report["healthy"] == 3
    assert [(fault["name"], fault["runs"]) for fault in report["faults"]] == [
        ("friction@transmission", 6),
        ("backlash@transmission", 6),
    ]
    friction = next(item for item in report["varied"] if item["name"] == "friction.dynamic")
    assert (friction["min"], friction["max"], sum(friction["histogram"])) == (0.2, 0.4, 12)
    assert sum(report["splits"].values()) == 12
    assert cli("dataset", "describe", made, json_output=False)[0] == 0


def test_cards_tell_what_is_in_it(made):
    text, page = (made / "README.md").read_text(), (made / "card.html").read_text()
    for content in (text, page):
        for word in ("backlash@transmission", "friction.dynamic", "12 ok", "load_campaign"):
            assert word in content
    assert "elevon-chart" in page
    assert "backlash@transmission: output_position" in page
    assert "http:" not in page.replace("http://www.w3.org", "").split("<style>")[0]


def test_cards_list_what_does_not_act_and_what_failed(plan, cli, tmp_path):
    tail = '[[vary]]\nparameter = "solver.step"\nvalues = ["1 us", "2 us"]\n'
    path = plan(0, head="allow_not_acting = true", tail=tail)
    code, report, err = cli("campaign", "run", path, "--out", tmp_path / "out")
    assert code == 0
    assert "solver.step = 2 us has no effect" in report["not_acting"][0]
    assert "has no effect" in err
    for name in ("README.md", "card.html"):
        assert "solver.step = 2 us has no effect" in (tmp_path / "out" / name).read_text()


def test_what_the_fidelity_does_not_carry(plan, cli, tmp_path):
    """Refused, unless the plan allows it: the label stays, so that low and high can be paired."""
    from elevon.faults import catalogue

    record = next(r for r in catalogue("rotary") if r.fidelities == ("high",))
    name = f"{record.kind}@{record.places[0]}"
    low = record.minimum if record.minimum > -1e9 else 0.0
    value = min(record.maximum, low + 0.01) or 0.01
    tail = f'[[vary]]\nfault = "{name}"\nvalues = [0, {value}]\n'
    code, _, err = cli("campaign", "run", plan(0, tail=tail), "--out", tmp_path / "out")
    assert code == 2
    assert "run 1: " in err
    assert "exists at fidelity high, not low" in err
    allowed = plan(0, head="allow_not_acting = true", tail=tail)
    code, report, _ = cli("campaign", "run", allowed, "--out", tmp_path / "out")
    assert code == 0
    assert name in report["not_acting"][0]
    ds = elevon.load_campaign(tmp_path / "out")
    assert ds.runs.to_pandas()[name].tolist() == [0.0, value]
    assert (ds.signals.to_pandas()[name] == 0.0).all()
    assert name in (tmp_path / "out" / "README.md").read_text()


def test_export_for_matlab(made, cli, tmp_path):
    from scipy.io import loadmat

    code, report, _ = cli("dataset", "export", made, "--out", tmp_path / "mat", "--runs", "0,6-7")
    assert code == 0
    assert report["runs"] == 3
    table = loadmat(tmp_path / "mat" / "runs.mat", squeeze_me=True, simplify_cells=True)
    assert table["runs"]["run"].tolist() == [0, 6, 7]
    assert table["names"]["backlash_at_transmission"] == "backlash@transmission"
    assert table["units"]["backlash_at_transmission"] == "rad"
    assert list(table["runs"]["case"]) == ["healthy", "rubbing", "rubbing"]
    run = loadmat(tmp_path / "mat" / "run_000007.mat", simplify_cells=True)
    alone = elevon.load_campaign(made).recording(7)
    clock = run["at_400_hz"]
    assert clock["motor_speed"].tobytes() == alone["motor_speed"].values.tobytes()
    growing = alone_of(made, 7)["fault_1"].values
    assert clock["friction_at_transmission"].tobytes() == growing.tobytes()
    healthy = loadmat(tmp_path / "mat" / "run_000000.mat", simplify_cells=True)
    assert (healthy["at_400_hz"]["friction_at_transmission"] == 0.0).all()
    again = elevon.Recording.load(tmp_path / "mat" / "run_000007.mat")
    assert {label["channel"] for label in again.labels} == {
        "friction_at_transmission", "backlash_at_transmission"
    }  # fmt: skip
    assert cli("dataset", "export", made, "--out", tmp_path / "mat", "--runs", "0")[0] == 2


@pytest.mark.parametrize("form", ["csv", "parquet", "nc"])
def test_export_in_other_forms(made, cli, tmp_path, form):
    arguments = ["--out", tmp_path / form, "--runs", "3", "--format", form]
    assert cli("dataset", "export", made, *arguments)[0] == 0
    assert (tmp_path / form / f"runs.{form}").stat().st_size > 0
    loaded = elevon.Recording.load(tmp_path / form / f"run_000003.{form}")
    if form == "csv":
        assert (tmp_path / form / "run_000003.csv.json").is_file()
        heads = (tmp_path / form / "runs.csv").read_text().splitlines()[0]
        assert '"sim_s [s]"' in heads
    alone = elevon.load_campaign(made).recording(3)
    assert loaded["output_position"].values.tobytes() == alone["output_position"].values.tobytes()


def test_names_for_matlab_differ():
    names = ["short@motor.phase_a", "a" * 40 + "x", "a" * 40 + "y", "1st", "command.terms[0].phase"]
    plain = identifiers(names)
    assert plain["short@motor.phase_a"] == "short_at_motor_phase_a"
    assert plain["command.terms[0].phase"] == "command_terms_0_phase"
    assert len(set(plain.values())) == len(names)
    assert all(name.isidentifier() and len(name) <= 31 for name in plain.values())


@pytest.mark.parametrize("text", ["", "a", "3-1", "0-12", "-1"])
def test_runs_that_cannot_be(text):
    with pytest.raises(InputError, match="--runs"):
        run_numbers(text, 12)


def test_splitting_anew(copied, cli):
    before = {p: p.read_bytes() for p in (copied / "runs").rglob("*.parquet")}
    code, report, _ = cli("dataset", "split", copied, "--share", "fit=0.75", "--share", "hold=0.25")
    assert (code, report["splits"]) == (0, {"fit": 9, "hold": 3})
    assert describe(elevon.load_campaign(copied))["splits"] == {"fit": 9, "hold": 3}
    assert cli("dataset", "verify", copied)[0] == 0
    assert {p: p.read_bytes() for p in before} == before
    assert "9 fit" in (copied / "README.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--share", "a=0.5"], "add up to 1"),
        (["--share", "a=1", "--by", "run"], "would leak"),
        (["--share", "a=1", "--by", "unit"], "no population"),
        (["--share", "a"], "NAME=SHARE"),
        (["--share", "a=0.99", "--share", "b=0.01"], "is none"),
    ],
)
def test_splits_that_cannot_be(copied, cli, arguments, message):
    text = json.loads((copied / "manifest.json").read_text())
    code, _, err = cli("dataset", "split", copied, *arguments)
    assert code == 2
    assert message in err
    assert json.loads((copied / "manifest.json").read_text()) == text
