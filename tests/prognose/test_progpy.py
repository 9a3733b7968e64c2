"""ProgPy: its simulation and predictions of our model, and samples both ways (needs the extra)."""

import numpy as np
import pytest

from elevon.errors import InputError
from elevon.prognose.future import look_ahead
from elevon.prognose.mission import Usage
from elevon.prognose.progpy import from_samples, progpy_model, to_samples
from tests.prognose.units import end, law, process


def test_without_progpy_the_extra_is_named(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "progpy", None)
    with pytest.raises(InputError, match=r"elevon\[progpy\]"):
        progpy_model(process(law()))


@pytest.mark.filterwarnings("ignore")
class TestWithProgpy:
    @pytest.fixture(autouse=True)
    def _there(self):
        pytest.importorskip("progpy")

    def test_its_simulation_fails_where_the_closed_form_does(self):
        unit = process(law(1e-3, power=1.0), limits=(2.0,))
        model = progpy_model(unit, step=5.0)
        result = model.simulate_to_threshold(lambda *_: model.InputContainer({}), dt=5.0,
                                             save_freq=50.0)  # fmt: skip
        assert result.times[-1] == pytest.approx(end(1e-3, 2.0, 1.0), abs=6.0)
        state = result.event_states[-1]
        assert state["backlash limit"] == pytest.approx(0.0, abs=0.01)
        severities = np.array([z["backlash@transmission"] for z in result.outputs])
        expected = np.expm1(1e-3 * np.array(result.times))
        np.testing.assert_allclose(severities, expected, rtol=1e-4, atol=1e-6)

    def test_samples_go_there_and_back(self):
        unit = process(
            law(1e-3, dormant=0.4), law(2e-3, "friction", rate_spread=0.2), limits=(1.0, 1.0)
        )
        units = unit.start(50, np.random.default_rng(0))
        back = from_samples(to_samples(units, unit), unit, usage=units.usage)
        np.testing.assert_array_equal(back.damage, units.damage)
        np.testing.assert_array_equal(back.active, units.active)
        np.testing.assert_array_equal(back.row, units.row)
        np.testing.assert_allclose(back.growth[back.active], units.growth[units.active])
        with pytest.raises(InputError, match="damage friction"):
            from_samples([{"damage backlash@transmission": 0.0, "growth backlash@transmission": 0.0,
                           "row backlash@transmission": 0.0}], unit)  # fmt: skip

    def test_its_monte_carlo_predicts_the_ends_that_ours_does(self):
        from progpy.predictors import MonteCarlo

        unit = process(law(1e-3, spread=0.3), limits=(1.0,))
        units = unit.start(40, np.random.default_rng(1))
        ours = look_ahead(unit, units, Usage(), np.random.default_rng(2)).end
        model = progpy_model(unit, step=20.0)
        theirs = MonteCarlo(model).predict(
            to_samples(units, unit), lambda *_: model.InputContainer({}), n_samples=40, dt=20.0,
            horizon=5000.0, save_freq=5000.0,
        )  # fmt: skip
        ends = np.array([t["backlash limit"] for t in theirs.time_of_event])
        assert np.median(ends) == pytest.approx(np.median(ours), rel=0.12)
        assert np.std(ends) == pytest.approx(np.std(ours), rel=0.5)
