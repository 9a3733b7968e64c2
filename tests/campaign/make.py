"""What several tests of campaigns look for."""

import elevon


def whole(out, total):
    """Assert that a folder holds every run once, and return its samples."""
    ds = elevon.load_campaign(out)
    runs = ds.runs.to_pandas()
    assert list(runs.run) == list(range(total))
    assert set(runs.status) == {"ok"}
    samples = ds.signals.to_pandas()
    assert samples.groupby("run").size().to_dict() == dict.fromkeys(range(total), 5)
    assert not (out / "progress.log").exists()
    return samples
