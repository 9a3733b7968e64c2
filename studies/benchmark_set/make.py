"""The benchmark set: three actuators, units that grow faults, and a bench that does not match."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from elevon.errors import InputError, unknown
from elevon.files import read_regular, write_text
from elevon.progress import Progress, part
from elevon.worklog import locked

#: Raised whenever the same seed and size give other data on purpose.
BENCHMARK_VERSION = "1.0"
BENCHMARK = "benchmark.json"
ACTUATORS = ("torino-rotary", "nasa-ballscrew", "pisa-landing-gear")

#: Units of each actuator, and ages at which each is seen.
SIZES: Mapping[str, tuple[int, int]] = {"small": (30, 6), "full": (240, 8)}

#: Units of the mismatched bench, over those of the actuator file.
_SHIFTED = 1.0 / 3.0
_SPLIT = {"train": 0.5, "validation": 0.2, "test": 0.3}
_LEAST_UNITS = 10
#: Spread of the supply voltage over the actuator file's value.
_VOLTAGE = 0.03


@dataclass(frozen=True)
class Made:
    """What was made.

    Attributes
    ----------
    folder : Path
        Of the set.
    about : dict
        As in ``benchmark.json``: version, seed, size, campaigns with hashes.
    failed : int
        Runs that failed.
    """

    folder: Path
    about: dict[str, Any]
    failed: int


_LONGEST = 2**24


def make_benchmark(
    out: str | os.PathLike[str],
    *,
    size: str = "small",
    runs: int | None = None,
    seed: int = 0,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Made:
    """Make the benchmark set, or go on with one that was interrupted.

    Each actuator is a campaign of its own with train, validation and test dealt by unit, and a
    second one of other units on a mismatched bench (another friction law, sensors with errors).

    Parameters
    ----------
    out : path
        The folder; made when absent.
    size : str
        ``small`` or ``full``.
    runs : int, optional
        About so many runs in all, in place of `size`.
    seed : int
        Of units, growth, draws, split and noise.
    threads : int, optional
        Default: one a core.
    progress : callable, optional
        Called with the done fraction; returning False interrupts.

    Raises
    ------
    InputError
        Too few runs; the folder holds another set or something else.
    Interrupted
        `progress` returned False. What is done is kept.
    """
    from elevon.campaign import run_campaign

    folder = Path(out).expanduser()
    units, ages = _size(size, runs)
    shifted = max(math.ceil(_SHIFTED * units), 3)
    settings = {"version": BENCHMARK_VERSION, "seed": seed, "units": units, "ages": ages}
    _check_same(folder, settings)
    plans = {}
    for number, name in enumerate(ACTUATORS):
        plan_seed = 1000 * seed + 10 * number
        plans[name] = plan_text(name, units, ages, plan_seed)
        plans[f"{name}-shifted"] = plan_text(name, shifted, ages, plan_seed + 5, shifted=True)
    campaigns, failed = [], 0
    for place, (name, text) in enumerate(plans.items()):
        result = run_campaign(
            _resolved(text, name),
            text,
            folder / name,
            threads=threads,
            progress=part(progress, place / len(plans), (place + 1) / len(plans)),
        )
        failed += len(result.failed)
        campaigns.append(_campaign(name, result.manifest))
    about = {**settings, "elevon": result.manifest.version, "campaigns": campaigns}
    with locked(folder):
        write_text(folder / "README.md", _card(about), force=True)
        write_text(folder / BENCHMARK, json.dumps(about, indent=1) + "\n", force=True)
    return Made(folder, about, failed)


def plan_text(name: str, units: int, ages: int, seed: int, *, shifted: bool = False) -> str:
    """Return the plan of one actuator's campaign (TOML).

    Parameters
    ----------
    name : str
        The actuator.
    units, ages : int
        Units, and ages at which each is seen.
    seed : int
        Of the population, the draws, the split and the noise.
    shifted : bool
        On the mismatched bench.
    """
    import tomlkit

    if name not in ACTUATORS:
        raise unknown("actuator of the benchmark", name, ACTUATORS)
    plans = files("studies.benchmark_set") / "plans"
    text = (plans / f"{name}.toml").read_text("utf-8")
    voltage = _voltage(name)
    text = text.replace("@VOLTAGE_LOW@", f"{voltage * (1.0 - _VOLTAGE):.6g}")
    text = text.replace("@VOLTAGE_HIGH@", f"{voltage * (1.0 + _VOLTAGE):.6g}")
    plan: Any = tomlkit.parse(text)
    plan["seeds"] = [seed]
    plan["split_seed"] = seed
    plan["population"].update({"units": units, "points": ages, "seed": seed})
    plan["random"]["seed"] = seed
    plan["split"] = {"shifted": 1.0} if shifted else dict(_SPLIT)
    if shifted:
        mismatch = tomlkit.parse((plans / "shifted.toml").read_text("utf-8"))
        plan["name"] = f"{plan['name']}-shifted"
        plan["parameters"] = dict(mismatch[name])
    return tomlkit.dumps(plan)


def _voltage(name: str) -> float:
    from elevon.actuator import Actuator

    return Actuator.load(name).parameters.value("inverter.supply_voltage")


def _size(size: str, runs: int | None) -> tuple[int, int]:
    if size not in SIZES:
        raise unknown("size", size, SIZES)
    units, ages = SIZES[size]
    if runs is not None:
        units = round(runs / (len(ACTUATORS) * ages * (1.0 + _SHIFTED)))
    if units < _LEAST_UNITS:
        least = math.ceil(_LEAST_UNITS * len(ACTUATORS) * ages * (1.0 + _SHIFTED))
        raise InputError(f"runs = {runs}: too few to deal units to three parts; at least {least}")
    return units, ages


def _resolved(text: str, name: str) -> Any:
    from tempfile import TemporaryDirectory

    from elevon.campaign import load_plan, resolve_plan

    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.toml"
        path.write_text(text, encoding="utf-8")
        return resolve_plan(*load_plan(path))


def _check_same(folder: Path, settings: Mapping[str, Any]) -> None:
    """Refuse a folder with another set."""
    path = folder / BENCHMARK
    if not path.is_file():
        return
    known = json.loads(read_regular(path, _LONGEST))
    other = [key for key in settings if known.get(key) != settings[key]]
    if other:
        key = other[0]
        raise InputError(
            f"{folder}: holds another benchmark set: {key} = {known.get(key)}, not "
            f"{settings[key]}; give a new folder"
        )


def _campaign(name: str, manifest: Any) -> dict[str, Any]:
    """Return what a campaign is, with a hash of all its data."""
    hashes = sorted(
        (path, about["sha256"])
        for block in manifest.blocks
        for path, about in block["files"].items()
    )
    return {
        "folder": name,
        "runs": manifest.total,
        "faults": [fault["name"] for fault in manifest.faults],
        "plan_hash": manifest.plan_hash,
        "data_hash": hashlib.sha256(json.dumps(hashes).encode()).hexdigest(),
    }


def _card(about: Mapping[str, Any]) -> str:
    rows = [
        f"| `{c['folder']}` | {c['runs']} | {', '.join(f'`{f}`' for f in c['faults'])} |"
        for c in about["campaigns"]
    ]
    text = (files("studies.benchmark_set") / "plans" / "README.md").read_text("utf-8")
    for key in ("version", "seed", "units", "ages", "elevon"):
        text = text.replace(f"@{key.upper()}@", str(about[key]))
    return text.replace("@CAMPAIGNS@", "\n".join(rows))
