"""Features in a campaign: a table of their own, without signals where none are wanted."""

import numpy as np
import pytest

import elevon
from elevon.features import recording_features


def test_features_without_signals_equal_those_of_the_signals(plan, cli, tmp_path):
    wanted = 'runs_per_file = 2\nfeatures = "level,friction,orders@2 kHz"\nrecord = []'
    cli("campaign", "run", plan(count=5, head=wanted, bare=True), "--out", tmp_path / "bare")
    signals = 'record = "all@2 kHz"'
    cli("campaign", "run", plan(count=5, head=signals, bare=True), "--out", tmp_path / "full")
    ds, full = (elevon.load_campaign(tmp_path / name) for name in ("bare", "full"))
    table = ds.features.to_arrow()
    assert table["run"].to_pylist() == list(range(5))
    assert table.schema.field("friction_loop_area").metadata[b"unit"] == b"A rad"
    for number in range(5):
        again = recording_features(full.recording(number), pole_pairs=4).values
        row = {name: table[name][number].as_py() for name in table.column_names[1:]}
        assert np.array_equal(list(row.values()), [again[n] for n in row], equal_nan=True)
    with pytest.raises(elevon.InputError, match="features only"):
        _ = ds.signals


def test_a_feature_that_cannot_be_is_refused_before_anything_is_written(plan, cli, tmp_path):
    path = plan(count=1, head='features = "vibration_rms@400 Hz"')
    code, _, error = cli("campaign", "run", path, "--out", tmp_path / "out")
    assert code == 2
    assert "vibration" in error
    assert not (tmp_path / "out").exists()
