"""Work is pinned, time is not: steps, leg transitions and samples of the common job are those of
its definition.
"""

from __future__ import annotations

import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import elevon
from benchmarks import job

C_SOURCE = Path(__file__).resolve().parents[2] / "benchmarks" / "benchmark_job.c"


@pytest.fixture(scope="module")
def yardstick(tmp_path_factory: pytest.TempPathFactory) -> dict[str, float]:
    """One simulated second of the common job in C, transitions counted."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler: the yardstick cannot be built")
    target = tmp_path_factory.mktemp("c") / "job"
    subprocess.run(
        [compiler, "-O2", "-DCOUNT", str(C_SOURCE), "-o", str(target), "-lm"], check=True
    )
    line = subprocess.run(
        [str(target), "1000000", "1"], check=True, capture_output=True, text=True
    ).stdout
    return {name: float(value) for name, value in (pair.split("=") for pair in line.split())}


@pytest.fixture(scope="module")
def common() -> object:
    """The same second through the public call."""
    return elevon.simulate(job.actuator(), job.scenario(1.0), record=job.RECORD)


def test_one_simulated_second_is_a_million_steps_and_four_hundred_samples(common: object) -> None:
    """No step more, no sample twice."""
    assert common.meta["steps"] == 1_000_000
    time = common["output_position"].time
    assert time.size in (400, 401)
    assert np.allclose(np.diff(time), 2.5e-3, rtol=0, atol=1e-12)


def test_angle_and_transitions_agree_with_the_yardstick(
    common: object, yardstick: dict[str, float]
) -> None:
    """0.01 deg and 5 %: the agreement the benchmark stands on."""
    assert math.degrees(common.final["output_position"]) == pytest.approx(
        yardstick["output_deg"], abs=0.01
    )
    assert common.final["leg_transitions"] == pytest.approx(yardstick["transitions"], rel=0.05)


def test_full_options_take_no_more_steps() -> None:
    """Options cost time per step, never steps."""
    rec = elevon.simulate(
        job.actuator("full"), job.scenario(0.01, variant="full"), record=job.RECORD
    )
    assert rec.meta["status"] == "ok"
    assert rec.meta["steps"] == 10_000


def test_low_fidelity_takes_a_hundredth_of_the_steps() -> None:
    """1e-4 s or larger."""
    rec = elevon.simulate(
        elevon.Actuator.load("torino-rotary"),
        job.scenario(1.0),
        fidelity="low",
        record=["output_position@400 Hz"],
    )
    assert rec.meta["steps"] <= 10_000
