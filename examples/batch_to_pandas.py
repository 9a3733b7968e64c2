"""Two hundred units with faults of drawn severity, in batches and threads, into one table."""

import numpy as np
import pandas as pd

import elevon

draws = np.random.default_rng(1).uniform([0.0, 0.2], [0.3, 1.5], (200, 2))  # share, deg
sine = {"kind": "sine", "amplitude": "5 deg", "frequency": "1 Hz"}
scenario = elevon.Scenario.from_dict({"duration": "1 s", "command": {"terms": [sine]}})
faults = [[f"short@motor.phase_a={s}", f"backlash@transmission={p} deg"] for s, p in draws]
runs = [elevon.Run("torino-rotary", scenario.with_faults(each)) for each in faults]
answers = elevon.simulate_batch(runs, fidelity="low", record=[], features="all@400 Hz")
table = pd.DataFrame([r.meta["features"] for r in answers]).assign(
    short=draws[:, 0], backlash=draws[:, 1]
)
print(table.shape, table.corr(method="spearman")["backlash"].abs().nlargest(4).round(2).to_dict())
