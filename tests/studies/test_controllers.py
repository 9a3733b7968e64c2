"""The study of the mechanics' intervals under known and other controllers, small."""

import numpy as np

from elevon.plain import plain
from studies.controllers import KNOWN, NAMES, OTHERS, TYPICAL, _logs, study_controllers


def test_every_drive_follows_its_command():
    drives = [*KNOWN, *OTHERS]
    truth = np.tile(TYPICAL, (len(drives), 1))
    commands, seen, efforts = _logs(drives, truth, np.random.default_rng(1))
    error = np.std((commands - seen)[2000:], axis=0)
    assert np.all(error < 0.1 * np.std(commands, axis=0)), dict(zip(drives, error, strict=True))
    assert np.all(np.isfinite(efforts))


def test_a_small_study_counts_every_interval():
    result = study_controllers(fits=7, seed=3)
    document = plain(result)
    assert document["known"]["fits"] + document["others"]["fits"] == 7
    assert result.known.intervals == 4 * len(NAMES)
    assert {row["drives"] for row in result.rows} == {"known", "others", *KNOWN, *OTHERS}
    assert all(0.0 <= row["coverage"] <= 1.0 for row in result.rows)
