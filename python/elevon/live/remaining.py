"""Remaining life from a diagnosis of the live bench, at a mission's rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elevon.errors import ElevonError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.answer import Diagnosis


def remaining_life(answer: Diagnosis, actuator: Actuator, mission: str) -> str:
    """Return the prediction in a sentence, or why there is none."""
    from elevon.prognose.door import predict

    try:
        return predict([(0, answer)], actuator, mission).headline
    except ElevonError as error:
        return f"no prediction: {error}"
