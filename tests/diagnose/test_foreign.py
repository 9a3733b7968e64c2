"""Units of another program: an encoder whose phase is new at each power-up is no fault."""

from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator, calibrate
from elevon.diagnose.by_model import diagnose, reading_of
from elevon.diagnose.learning.fit import share_interval
from elevon.logs.read import read_logs
from studies.independent.bench import TESTS, singles, together, units, written
from tests.calibrate.foreign import NOLOAD, draw, run
from tests.diagnose.virtual import bench_logs

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
ALARMS = ("faulty", "unknown_fault")


def test_the_foreign_encoder_errs_once_a_turn_of_its_wheel():
    bench, sensors = draw(3)
    plain = run(bench, sensors, NOLOAD, seed=1, duration=3.0)
    off = replace(sensors, encoder_error=2e-4, encoder_turns=4.0, encoder_phase=0.7)
    done = run(bench, off, NOLOAD, seed=1, duration=3.0)
    assert np.abs(done.rows["output"] - plain.rows["output"]).max() < 4e-4
    true = (done.rows["motor"] - plain.rows["motor"]) / bench.ratio
    seen = done.rows["output"] - plain.rows["output"] - true
    expected = 2e-4 * np.sin(4.0 * plain.rows["output"] + 0.7)
    assert np.std(seen - expected) < 0.5 * np.std(expected) + 1e-4


def test_what_an_encoders_free_phase_moves_is_spread_of_a_healthy_unit():
    """A slope of the two positions' ratio: the wheel's turns, times a size even up to its class."""
    unit = Actuator.load("torino-rotary")
    (log,) = bench_logs(unit, [(1, [])])
    features, plausible = reading_of(log, unit).periodic()
    slope = np.hypot(*(v.only(["position_scale"]).values[0] for v in features))
    # Mean square of a size that is even up to A: A^2/3; half of it along either phase.
    assert slope == pytest.approx(4.0 * 2e-4 / np.sqrt(6.0), rel=0.2)
    assert max(abs(v.only(["dry_current"]).values[0]) for v in features) < 1e-9
    assert any(abs(v.only(["position_bend"]).values[0]) > 1e-3 for v in plausible)


@pytest.mark.long
@pytest.mark.parametrize("baselines", [1, 3])
def test_calibrated_foreign_units_keep_the_rate_and_show_their_faults(tmp_path, baselines):
    """Each log has baselines of its own; encoder, gear, windings and friction new each day."""
    healthy, named, faults = 0, 0, 0
    alarms = 0
    for unit in units(4731, 2):

        def log(test, number, cause=None, unit=unit):
            place = tmp_path / f"{unit.number}-{number}"
            seed = 10_000 * unit.number + 3000 * list(TESTS).index(test) + number
            return read_logs([written(unit, test, place, seed, cause)])[0]

        file = calibrate([log(test, 0) for test in TESTS], "torino-rotary").actuator
        for test in ("noload", "chirp"):
            for k in range(8):
                base = [log(test, 200 + 10 * k + n) for n in range(baselines)]
                healthy += 1
                alarms += diagnose([log(test, 100 + k)], file, baselines=base).status in ALARMS
            for k, some in enumerate(singles(unit)):
                base = [log(test, 500 + 10 * k + n) for n in range(baselines)]
                made = log(test, 1000 + k, together(some))
                faults += 1
                named += diagnose([made], file, baselines=base).best == (some[0].key,)
    print(alarms, healthy, share_interval(alarms, healthy))  # noqa: T201
    print(named, faults, share_interval(named, faults))  # noqa: T201
    assert share_interval(alarms, healthy)[0] <= 0.05
    assert share_interval(named, faults)[1] >= 0.9
