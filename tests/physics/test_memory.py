"""Memory of a run is bounded by what is recorded, not by what is simulated."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

PROGRAM = """
    import resource, sys
    from tests.physics.rig import HYSTERESIS, MOTOR, run, term

    def peak():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

    duration = float(sys.argv[1])
    command = [term("sine", amplitude="7 deg", frequency="0.2 Hz")]
    record = "drive_log@400 Hz"
    run(MOTOR | HYSTERESIS, duration=0.05, command=command, record=record)
    before = peak()
    rec = run(MOTOR | HYSTERESIS, duration=duration, command=command, record=record)
    names = [n for n in rec.names]
    print(before, peak(), sum(rec[n].values.nbytes for n in names) / 2**20)
"""


def measure(duration: float) -> tuple[float, float, float]:
    """Peak MB before and after a run of `duration` in a fresh process, and MB of the samples it
    returned.
    """
    out = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(PROGRAM), str(duration)],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    ).stdout
    before, after, samples = (float(x) for x in out.split())
    return before, after, samples


def test_memory_grows_with_the_samples_only() -> None:
    """20 s are 20 million steps: one signal at every step would already be 160 MB. Three times the
    samples and 5 MB are allowed for copies and the allocator."""
    before, after, samples = measure(20.0)
    assert samples > 0.5
    assert after - before < 3 * samples + 5.0


@pytest.mark.long
def test_a_thousand_seconds_stay_under_300_megabytes() -> None:
    """The drive's log at 400 Hz: whole process, interpreter and libraries included."""
    _, after, samples = measure(1000.0)
    assert samples > 20.0
    assert after < 300.0
