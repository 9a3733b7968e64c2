"""Foreign benches, each drawn by its seed and unlike the others in drive, sensors or files."""

from dataclasses import dataclass, field, replace

from tests.calibrate.foreign import CHIRP, LOADED, NOLOAD, draw
from tests.calibrate.foreign_files import Style


@dataclass(frozen=True)
class Case:
    """A bench of the collection."""

    text: str
    seed: int
    bench: dict = field(default_factory=dict)
    sensors: dict = field(default_factory=dict)
    style: Style = field(default_factory=Style)
    trials: dict = field(default_factory=dict)

    def build(self):
        """Return bench, sensors, style and trials."""
        bench, sensors = draw(self.seed, self.bench, self.sensors)
        trials = {"noload": NOLOAD, "chirp": CHIRP, "loaded": LOADED} | self.trials
        return bench, sensors, self.style, trials


def _chirp(amplitude, end):
    values = CHIRP.values | {"amplitude": amplitude, "end_frequency": end}
    return {"chirp": replace(CHIRP, values=values)}


CASES = {
    "plain": Case("125 us, N = 10; encoder on the motor shaft, rms, signed cell of 80 Hz", 0),
    "no-derivative": Case(
        "250 us, no derivative; slow shaft, semicolons, decimal comma, CRLF, peak, positive cell",
        1,
        {"sample_time": 250e-6, "derivative_time": 0.0},
        {"cell": "positive"},
        Style(
            delimiter=";", decimal_comma=True, line_end="\r\n", encoder_shaft="slow", current="peak"
        ),
    ),
    "slow-drive": Case(
        "1 ms, N = 5; motor angle to 1e-3 deg, byte-order mark, cell of 10 Hz",
        2,
        {"sample_time": 1e-3, "derivative_filter": 5.0},
        {"motor_rounding": 1e-3, "cell_rate": 10.0},
        Style(bom=True),
        _chirp(3.0, 1.5),
    ),
    "sharp-derivative": Case(
        "125 us, N = 100; Latin-1, an extra column, no r76, no r1733",
        3,
        {"derivative_filter": 100.0},
        {},
        Style(
            encoding="latin-1",
            extra="Temperatur [°C]",
            missing=("field", "voltage"),
            note_keys="units",
        ),
    ),
    "two-mass": Case(
        "elastic backlash between two masses, friction at the output", 4, {"elastic": True}
    ),
    "no-arm": Case(
        "a load cell, its arm unknown", 5, {}, {}, Style(noted_arm=False, encoder_shaft="slow")
    ),
    "no-cell": Case(
        "no load cell, no measured current (r78)",
        6,
        {"quantised_loop": False},
        {"cell": "none"},
        Style(missing=("current",), note_keys="nested"),
    ),
    "rough": Case(
        "cogging, friction that falls with speed, wobbling brake, smoothed speed, late encoder",
        7,
        {"cogging": 0.02, "stribeck": 0.8},
        {"speed_cutoff": 150.0, "encoder_delay": 1e-3, "encoder_gain": 1.004, "current_step": 0.03},
        Style(),
        _chirp(1.0, 6.0) | {"loaded": replace(LOADED, wobble=0.05)},
    ),
    "staircase": Case(
        "125 us, but the position loop only every 1 ms: the speed set point goes by stairs",
        8,
        {"position_sample_time": 1e-3},
    ),
}
