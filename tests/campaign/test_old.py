"""A data set of the former names: read with the present ones, checked by its hash, not changed."""

import shutil
import tarfile
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import elevon
from elevon.campaign import read_manifest
from elevon.cli import main
from elevon.errors import FormatError, RetiredNamesWarning

ARCHIVE = Path(__file__).parent / "old" / "campaign.tar.gz"


@pytest.fixture
def old(tmp_path):
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(tmp_path, filter="data")
    return tmp_path / "campaign"


@pytest.fixture
def ds(old):
    with pytest.warns(RetiredNamesWarning) as caught:
        loaded = elevon.load_campaign(old)
    assert len(caught) == 1
    return loaded


def test_every_table_has_the_present_names(ds):
    assert ds.signals.columns == [
        "run", "time", "output_position", "motor_speed", "current_q_meas", "backlash@transmission"
    ]  # fmt: skip
    assert ds.signals.schema.field("output_position").metadata[b"text"] == b"output position"
    frame = ds.signals.to_pandas(["time", "output_position"], runs=[3])
    assert frame.attrs["units"]["output_position"] == "rad"
    assert ds.signals.to_polars().collect().columns == ds.signals.columns
    assert ds.signals.to_duckdb().columns == ds.signals.columns
    assert "backlash@transmission" in ds.runs.to_pandas()
    assert ds.manifest.faults[0]["name"] == "backlash@transmission"
    assert "output_speed" in ds.ends.columns


def test_every_run_keeps_every_bit(ds, old):
    resolved = ds.resolved()
    assert resolved.columns[0].name == "backlash@transmission"
    raw = pq.read_table(old / "runs" / "at_400_hz" / "block_00000.parquet").to_pandas()
    ends = pq.read_table(old / "ends" / "block_00000.parquet").to_pandas()
    for number in range(len(ds)):
        recording, mine = ds.recording(number), raw[raw["run"] == number]
        assert next(c.name for c in recording.channels) == "output_position"
        assert recording.clock().time.tolist() == mine["time"].tolist()
        for place, channel in enumerate(recording.channels, start=2):
            assert channel.values.tolist() == mine.iloc[:, place].tolist(), channel.name
        assert recording.final["motor_speed"] == ends["motor_speed"][number]
        assert recording.labels[0]["severity"] == resolved.values(number)["backlash@transmission"]
        assert resolved.run(number).scenario.fault[0].kind == "backlash"


def test_the_hash_is_that_of_the_old_content(ds, old):
    text = (old / "resolved.json").read_text("utf-8")
    (old / "resolved.json").write_text(text.replace('"amplitude": "7 deg"', '"amplitude": "8 deg"'))
    with pytest.raises(FormatError, match="not as it was written"):
        ds.resolved()


@pytest.mark.filterwarnings("ignore::elevon.errors.RetiredNamesWarning")
def test_it_is_verified_described_and_exported(old, tmp_path, capsys):
    assert main(["dataset", "describe", str(old)]) == 0
    assert "backlash@transmission" in capsys.readouterr().out
    assert main(["dataset", "export", str(old), "--out", str(tmp_path / "x"), "--runs", "0"]) == 0
    saved = elevon.Recording.load(tmp_path / "x" / "run_000000.mat")
    assert "output_position" in [channel.name for channel in saved.channels]
    assert main(["dataset", "verify", str(old)]) == 0
    capsys.readouterr()


def test_it_is_not_changed(old, capsys):
    before = {path: path.read_bytes() for path in old.rglob("*") if path.is_file()}
    plan = old / "plan.toml"
    shutil.copy(plan, old.parent / "plan.toml")
    for command in (
        ["dataset", "split", str(old), "--share", "a=1"],
        ["dataset", "repair", str(old)],
        ["campaign", "resume", str(old)],
    ):
        assert main(command) == 2
        assert "was written by an earlier version" in capsys.readouterr().err
    assert main(["campaign", "run", str(plan), "--out", str(old)]) == 2
    assert "did you mean" in capsys.readouterr().err
    assert read_manifest(old).is_old
    assert {path: path.read_bytes() for path in old.rglob("*") if path.is_file()} == before
