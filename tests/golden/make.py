"""Answers of the commands on generated logs, kept as numbers and compared.

    python tests/golden/make.py FOLDER --write     # run and keep the answers in FOLDER/answers
    python tests/golden/make.py FOLDER             # run and compare with them to the bit
    python tests/golden/make.py FOLDER --close 1e-9 --only gear     # within a share, some cases

Logs are generated once into FOLDER/logs (by the bench, by `simulate`, and one foreign table of few
channels made of a simulation), so that a change of the bench or the core does not mix with one of
what reads logs. `seconds` and paths are left out. A case whose answer differs is printed with the
first places that differ; exit 1.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LINEAR = str(ROOT / "examples" / "linear-drive" / "drive.toml")
ROTARY, SCREW, GEAR = "torino-rotary", "nasa-ballscrew", "pisa-landing-gear"
#: What is no answer: time taken, where files lie.
_LEFT_OUT = {"seconds", "wall_s", "out", "report", "evaluations_per_second"}

BENCH = {
    "rot1": ["chirp", ROTARY, "1"],
    "rot2": ["chirp", ROTARY, "2"],
    "rotf": ["chirp", ROTARY, "3", "backlash@transmission=0.5deg"],
    "rotload": ["loaded", ROTARY, "4"],
    "screw1": ["ballscrew-profiles", SCREW, "1"],
    "screwf": ["ballscrew-profiles", SCREW, "2", "lubrication@transmission=2"],
    "lin1": ["ballscrew-profiles", LINEAR, "1"],
    "linf": ["ballscrew-profiles", LINEAR, "2", "backlash@transmission=0.1mm"],
    "gear1": ["gear-cycles", GEAR, "1"],
    "gear2": ["gear-cycles", GEAR, "2"],
}
_PROFILES = ("sine-free", "sine-opposing", "sweep-constant", "trapezoid-spring")


def _profiles(folder: str) -> list[str]:
    return [f"{folder}/{name}.csv" for name in (*_PROFILES, "triangle-opposing")]


def _cycles(folder: str) -> list[str]:
    moves = ("extension", "retraction")
    return [f"{folder}/{m}-{how}.csv" for m in moves for how in ("nominal", "normal")]


#: Name: arguments of the command; a name with "/" is a file of FOLDER/logs.
CASES: dict[str, list[str]] = {
    "rot-calibrate": ["calibrate", "rot1/chirp.csv", "--actuator", ROTARY, "--out", "@set.toml"],
    "rot-calibrate-loaded": [
        "calibrate", "rot1/chirp.csv", "rotload/loaded-1.csv", "--actuator", ROTARY,
        "--per-log", "backlash.total",
    ],
    "rot-calibrate-own": ["calibrate", "own/rotary.csv", "--actuator", ROTARY],
    "rot-calibrate-few": ["calibrate", "own/few.csv", "--actuator", ROTARY, "--map", "own/few.toml",
                          "--free", "control.position_gain,friction.dynamic"],
    "rot-validate": ["validate", "rot2/chirp.csv", "--actuator", ROTARY],
    "rot-validate-few": ["validate", "own/few.csv", "--actuator", ROTARY, "--map", "own/few.toml"],
    "rot-diagnose": ["diagnose", "rotf/chirp.csv", "--baseline", "rot1/chirp.csv", "--actuator",
                     ROTARY],
    "rot-diagnose-two": ["diagnose", "rotload/loaded-1.csv", "rot2/chirp.csv", "--actuator",
                         ROTARY],
    "rot-diagnose-own": ["diagnose", "own/rotary.csv", "--actuator", ROTARY],
    "rot-diagnose-both": ["diagnose", "rotf/chirp.csv", "--baseline", "rot1/chirp.csv",
                          "--actuator", ROTARY, "--method", "both"],
    "rot-monitor": ["monitor", "rot2/chirp.csv", "rotf/chirp.csv", "--baseline", "rot1/chirp.csv",
                    "--window", "2 s", "--actuator", ROTARY],
    "rot-next-test": ["next-test", "--actuator", ROTARY, "--so-far", "own/diagnosis.json"],
    "rot-predict": ["predict", "history/", "--actuator", ROTARY, "--mission", "mission.toml"],
    "screw-calibrate": ["calibrate", *_profiles("screw1"), "--actuator", SCREW,
                        "--out", "@set.toml"],
    "screw-validate": ["validate", "screw1/triangle-opposing.csv", "--actuator", SCREW],
    "screw-diagnose": ["diagnose", "screwf/sine-free.csv", "screwf/sine-opposing.csv",
                       "--baseline", "screw1/sine-free.csv", "--actuator", SCREW],
    "lin-calibrate": ["calibrate", *_profiles("lin1"), "--actuator", LINEAR],
    "lin-calibrate-few": ["calibrate", "lin1/sine-free.csv", "--actuator", LINEAR,
                          "--free", "control.position_gain"],
    "lin-validate": ["validate", "lin1/trapezoid-spring.csv", "--actuator", LINEAR],
    "lin-diagnose": ["diagnose", "linf/sine-free.csv", "--baseline", "lin1/sine-free.csv",
                     "--actuator", LINEAR],
    "gear-calibrate": ["calibrate", *_cycles("gear1")[::2], "--actuator", GEAR,
                       "--fidelity", "low", "--out", "@set.toml"],
    "gear-validate": ["validate", "gear1/extension-nominal.csv", "--actuator", GEAR],
    "gear-diagnose": ["diagnose", "gear2/extension-normal.csv", "--baseline",
                      "gear1/extension-normal.csv", "--actuator", GEAR],
    "studies-fault-limits": ["studies", "fault-limits", "--seed", "5", "--days", "2",
                             "--injected", "1", "--actuator", ROTARY],
}  # fmt: skip
#: Minutes: only with --long.
LONG = {
    "gear-calibrate-all": ["calibrate", *_cycles("gear1"), "--actuator", GEAR],
    "studies-limits": ["studies", "diagnosis-limits", "--seed", "3", "--runs", "1"],
    "studies-inspection": ["studies", "inspection-error", "--seed", "3", "--units", "2"],
    "studies-monitor": ["studies", "monitor-delay", "--seed", "3", "--units", "1"],
    "studies-optimisers": ["studies", "diagnosis-optimisers", "--seed", "3"],
}


def elevon(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command of this interpreter's package."""
    module = ["studies"] if arguments[0] == "studies" else ["elevon", arguments[0]]
    command = [sys.executable, "-m", *module, *arguments[1:]]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def _must(*arguments: str) -> str:
    done = elevon(*arguments)
    if done.returncode:
        sys.exit(f"{' '.join(arguments)}: {done.stderr}")
    return done.stdout


def make_logs(logs: Path) -> None:
    """Generate what is not there yet."""
    for name, (procedure, actuator, seed, *faults) in BENCH.items():
        if (logs / name / "done").is_file():
            continue
        shutil.rmtree(logs / name, ignore_errors=True)
        flags = [flag for fault in faults for flag in ("--fault", fault)]
        fidelity = ["--fidelity", "low"] if procedure != "chirp" else []
        _must("bench", "run", procedure, "--actuator", actuator, "--seed", seed, *flags,
              *fidelity, "--out", str(logs / name))  # fmt: skip
        (logs / name / "done").touch()
    if not (logs / "own" / "done").is_file():
        _self_made(logs)
        (logs / "own" / "done").touch()


def _self_made(logs: Path) -> None:
    """A simulation's own recording, a foreign table of few channels, a history, a mission."""
    place = logs / "own"
    place.mkdir(parents=True, exist_ok=True)
    (place / "run.toml").write_text(
        'duration = "8 s"\n[command]\nmode = "position"\n[[command.terms]]\nkind = "sine"\n'
        'amplitude = "5 deg"\nfrequency = "0.4 Hz"\n'
    )
    signals = (
        "command,encoder_position,resolver_position,speed_ref,motor_speed,current_ref,"
        "current_q_meas,voltage_q_ref"
    )
    scenario, out = str(place / "run.toml"), str(place / "rotary.csv")
    record = f"{signals}@250 Hz"
    _must("simulate", ROTARY, "--scenario", scenario, "--fidelity", "low", "--record", record,
          "--out", out, "--force")  # fmt: skip
    lines = (place / "rotary.csv").read_text().splitlines()
    head = [name.split(" [")[0] for name in lines[0].split(",")]
    keep = [head.index(name) for name in ("time", "command", "encoder_position")]
    rows = [[row.split(",")[k] for k in keep] for row in lines[1:]]
    (place / "few.csv").write_text(
        "\n".join(["t,demand,angle", *(",".join(r) for r in rows)]) + "\n"
    )
    (place / "few.toml").write_text(
        '[[column]]\nname = "t"\nrole = "time"\nunit = "s"\n[[column]]\nname = "demand"\n'
        'role = "command"\nunit = "rad"\n[[column]]\nname = "angle"\nrole = "output_position"\n'
        'unit = "rad"\n'
    )
    answer = _must("diagnose", str(logs / "rotf" / "chirp.csv"), "--actuator", ROTARY, "--json")
    (place / "diagnosis.json").write_text(answer)
    shutil.copy(ROOT / "examples" / "mission.toml", logs / "mission.toml")
    _history(logs)


def _history(logs: Path) -> None:
    folder = logs / "history"
    folder.mkdir(exist_ok=True)
    for k, name in enumerate(("rot1", "rot2", "rotf")):
        for end in ("chirp.csv", "chirp_command.json"):
            shutil.copy(logs / name / end, folder / f"{k}{end}")
        stamp = {"usage": 500.0 * k, "unit": "flights", "logs": [f"{k}chirp.csv"]}
        (folder / f"{k}.json").write_text(json.dumps(stamp | ({"healthy": True} if not k else {})))


def answer(arguments: list[str], logs: Path, kept: Path) -> object:
    """Run a case; return its JSON without what is no answer, and the set that it wrote."""
    written = [kept / f"new-{a[1:]}" for a in arguments if a.startswith("@")]
    full = [
        str(kept / f"new-{a[1:]}") if a.startswith("@")
        else str(logs / a) if (logs / a).exists() and not a.startswith("--") else a
        for a in arguments
    ]  # fmt: skip
    force = ["--force"] if written else []
    done = elevon(*full, *force, "--json")
    if not done.stdout:
        return {"exit": done.returncode, "error": done.stderr.replace(str(logs), "")[-600:]}
    out: dict[str, object] = {"exit": done.returncode, "json": _clean(json.loads(done.stdout))}
    for path in written:
        lines = path.read_text().replace(str(logs), "").splitlines()
        out["set"] = [line for line in lines if not line.startswith("#")]
        path.unlink()
    return out


def _clean(value: object) -> object:
    if isinstance(value, dict):
        return {k: _clean(v) for k, v in value.items() if k not in _LEFT_OUT}
    if isinstance(value, list):
        return [_clean(item) for item in value]
    return value


def differences(a: object, b: object, close: float, place: str = "") -> list[str]:
    """Return the places at which two answers differ."""
    if isinstance(a, dict) and isinstance(b, dict):
        keys = [*a, *(k for k in b if k not in a)]
        return [
            text
            for k in keys
            for text in (
                differences(a[k], b[k], close, f"{place}.{k}") if k in a and k in b
                else [f"{place}.{k}: only in the {'kept' if k in a else 'new'} answer"]
            )
        ]  # fmt: skip
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return [
            text
            for k, (x, y) in enumerate(zip(a, b, strict=True))
            for text in differences(x, y, close, f"{place}[{k}]")
        ]
    numbers = all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in (a, b))
    if numbers and close and math.isclose(a, b, rel_tol=close, abs_tol=1e-12):  # type: ignore[arg-type]
        return []
    return [] if a == b or (a != a and b != b) else [f"{place}: {str(a)[:90]} | {str(b)[:90]}"]


def say(text: str) -> None:
    """Print a line at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def main() -> int:
    """Run the cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--long", action="store_true")
    parser.add_argument("--close", type=float, default=0.0)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    folder = options.folder.resolve()
    kept = folder / "answers"
    kept.mkdir(parents=True, exist_ok=True)
    make_logs(folder / "logs")
    bad = 0
    for name, arguments in (CASES | (LONG if options.long else {})).items():
        if not name.startswith(options.only):
            continue
        result = answer(arguments, folder / "logs", kept if options.write else folder)
        file = kept / f"{name}.json"
        if options.write:
            file.write_text(json.dumps(result, indent=1) + "\n")
            say(f"{name}: kept, {file.stat().st_size} bytes")
            continue
        place = differences(json.loads(file.read_text()), result, options.close)
        bad += bool(place)
        say("\n   ".join([f"{name}: {'DIFFERS' if place else 'equal'}", *place[:8]]))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
