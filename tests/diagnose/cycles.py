"""Recordings in the layout of the Cranfield data, made up: no physics, only shapes."""

import numpy as np

from elevon.recording import Recording

PERIOD = 0.04
HEADER = "set_point,position_error,current,profile,load,run,fault_type,group,time\n"


def reference():
    """One cycle [mm]: 120 mm up in 5 s, a rest of 3 s, 120 mm down in 5 s."""
    up = 20.0 + 0.96 * np.arange(1, 126)
    return np.concatenate([up, np.full(75, 140.0), 140.0 - 0.96 * np.arange(1, 125)])


def cycle(random, *, load=20.0, friction=0.5, peak=0.1, ripple=0.0, noise=0.05):
    """Reference, tracking error [mm] and current [A] of one cycle."""
    ref = reference()
    direction = np.concatenate([np.ones(125), np.zeros(75), -np.ones(124)])
    time = PERIOD * np.arange(len(ref))
    since = np.concatenate([time[:125], np.full(75, 9.0), time[200:] - time[200]])
    moving = direction != 0
    current = 0.35 + moving * (friction - 0.004 * load * direction)
    current += moving * peak * np.exp(-(((since - 0.2) / 0.15) ** 2))
    error = 4.0 * direction * np.exp(-((since - 0.3) ** 2) / 0.1) * moving
    error = error + noise * random.standard_normal(len(ref))
    error = error + moving * ripple * np.sin(2.0 * np.pi * 2.5 * time)
    return ref, error, current + 0.02 * random.standard_normal(len(ref))


def recording(random, *, cycles=3, **options):
    """A recording of several cycles, each joined to the next by a gap."""
    parts = [cycle(random, **options) for _ in range(cycles)]
    ref, error, current = (np.concatenate(values) for values in zip(*parts, strict=True))
    count = len(parts[0][0])
    start = np.repeat(np.arange(cycles) * (count + 1) * PERIOD, count)
    time = start + np.tile(PERIOD * np.arange(count), cycles)
    gaps = [count * k - 1 for k in range(1, cycles)]
    load = np.full(len(ref), 9.80665 * options.get("load", 20.0))
    return Recording.build(
        time,
        {"position_ref": ref, "position": ref - error, "current": current, "load_force": load},
        {"position_ref": "mm", "position": "mm", "current": "A", "load_force": "N"},
        clock="drive",
        rate=1.0 / PERIOD,
        gaps=gaps,
        meta={"status": "measured", "log": "made.csv"},
    )


CLASSES = {
    "normal": {"friction": 0.5, "peak": 0.2},
    "backlash2": {"friction": 0.6, "peak": 0.0, "ripple": 0.0, "noise": 0.03},
    "lackLubrication2": {"friction": 0.6, "peak": 0.0, "ripple": 0.3},
    "spalling1": {"friction": 0.48, "peak": 0.25, "noise": 0.08},
}


def write_condition(folder, condition, *, loads=(20, 40, -40), runs=(8, 9, 10), seed=0, cycles=2):
    """Write one table in the layout of the published data."""
    random = np.random.default_rng([seed, len(condition), ord(condition[0])])
    stage = "".join(c for c in condition if c.isdigit()) or "0"
    lines = [HEADER]
    for load in loads:
        for run in runs:
            for group in range(cycles):
                ref, error, current = cycle(random, load=load, **CLASSES[condition])
                lines += [
                    f"{r:.2f},{e:.6f},{i:.6f},trap,{load},{run},{stage},{group},{PERIOD * k:.2f}\n"
                    for k, (r, e, i) in enumerate(zip(ref, error, current, strict=True))
                ]
    (folder / f"{condition}.csv").write_text("".join(lines))
