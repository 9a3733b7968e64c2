"""How far a log's noise alone moves its numbers: the log with as much noise again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.roles.channels import numbers_of_log
from elevon.diagnose.roles.role_test import RoleTest
from elevon.diagnose.roles.series import noise_deviation

if TYPE_CHECKING:
    from elevon.actuator import Actuator

_AGAIN = 8  # logs with noise added


def noise_of(item: RoleTest, actuator: Actuator, numbers: Mapping[str, float]) -> Floats:
    """Return each number's deviation by the noise of the log's channels, shape (k,).

    What of a channel changes from sample to sample counts as its noise; ripple faster than the
    log's clock is among it, and repeats as little.
    """
    sizes = {
        role: noise_deviation(values)
        for role, values in item.seen.items()
        if item.log.units[role] != "1" and len(values) > 3
    }
    rng = np.random.default_rng(15)
    rows = []
    for _ in range(_AGAIN):
        channels = {
            role: values + sizes.get(role, 0.0) * rng.standard_normal(len(values))
            if role in sizes
            else values
            for role, values in item.seen.items()
        }
        noisy = numbers_of_log(item, actuator, channels).values
        rows.append([noisy.get(name, value) for name, value in numbers.items()])
    return np.asarray(np.std(rows, axis=0, ddof=1), dtype=np.float64)
