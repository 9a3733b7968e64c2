"""What an accelerometer's log shows of the passes of a screw's balls, measured or of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.experiment import Experiment, Inputs, Variant
from elevon.features.envelope import EnvelopeOrders, ball_passes, envelope_orders

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

KIND = "spall"
NEEDED = ("vibration", "motor_position", "command")
_FASTER = 4.0  # samples a period of the structure: a slower log is none of an accelerometer
_BAND = (0.6, 1.6)  # of the structure's frequency
_SMOOTH = 2e-3  # s over which a load is averaged for the model's run


def shows_passes(log: Log, actuator: Actuator) -> bool:
    """Tell whether a log has an accelerometer, fast enough, of a screw that may have a spall."""
    known = actuator.parameters
    if "screw.spall_nut" not in known or not log.has(*NEEDED):
        return False
    return 1.0 / log.period > _FASTER * known.value("vibration.frequency")


@dataclass(frozen=True)
class PassReading:
    """One log: its passes, those in the current, and its test on the model."""

    log: Log
    actuator: Actuator

    @property
    def orders(self) -> dict[str, float]:
        """Passes a turn of the motor by place."""
        value = self.actuator.parameters.value
        return ball_passes(
            value("screw.balls_per_turn"), value("screw.ball_diameter"),
            value("screw.pitch_diameter"), value("screw.contact_angle"), value("gear.ratio"),
        )  # fmt: skip

    def of(self, log: Log) -> EnvelopeOrders:
        """Return the accelerometer's passes of a log, or of a run on a log's channels."""
        frequency = self.actuator.parameters.value("vibration.frequency")
        band = (_BAND[0] * frequency, min(_BAND[1] * frequency, 0.45 / log.period))
        rate = 1.0 / log.period
        return envelope_orders(
            log["motor_position"], log["vibration"], rate, self.orders, band=band
        )

    def measured(self) -> EnvelopeOrders:
        """Return the log's own."""
        return self.of(self.log)

    def of_current(self) -> EnvelopeOrders | None:
        """Return the passes in the torque current, which has no structure to ring."""
        if not self.log.has("torque_current"):
            return None
        log = self.log
        return envelope_orders(
            log["motor_position"], log["torque_current"], 1.0 / log.period, self.orders
        )

    def simulated(self, place: str, sizes: Sequence[float]) -> list[EnvelopeOrders]:
        """Return what spalls of some lengths [m] show in the same test: runs of the model."""
        log = self.log
        loads = (
            {"output": (log.time, _averaged(log["load"], log.period))} if log.has("load") else {}
        )
        inputs = Inputs(
            log.duration, "position", command=(log.time, log["command"]), loads=loads,
            initial=_begin(log, self.actuator),
        )  # fmt: skip
        stand = {**log.stand.parameters, "vibration.model": "resonance"}
        ready = self.actuator.with_values(stand, source="stand of the log", place=log.name)
        shows = {"vibration": "vibration", "motor_position": "motor_position"}
        test = Experiment(log, ready, inputs, shows, period=log.period, fidelity="high")
        runs = test.run([Variant(faults=(f"{KIND}@{place}={size!r}",)) for size in sizes])
        return [self.of(run.log) for run in runs]


def _averaged(values: Floats, period: float) -> Floats:
    width = max(1, round(_SMOOTH / period))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def _begin(log: Log, actuator: Actuator) -> dict[str, float]:
    value = actuator.parameters.value
    at = float(log["command"][0])
    turned = at * value("gear.ratio") / value("screw.lead")
    return {} if at == 0.0 else {"motor_position": turned, "output_position": at}
