"""Run the commands behind the evidence, keep what they wrote: `python tools/evidence.py [NAME]`.

Each record, docs/evidence/runs/NAME.json, has the command, the day, the commit and the checks as
the command printed them. `make docs` makes the pages of them; `--check` runs the commands again
and compares, and writes nothing.
"""

import datetime
import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RUNS = ROOT / "docs" / "evidence" / "runs"
#: Published cases that need no foreign data and take at most some minutes.
CASES = (
    "torino-backlash", "torino-compliance", "torino-validation", "torino-loaded", "torino-drops",
    "torino-fmeca", "low-fidelity", "nasa-current", "nasa-thermal", "pisa-functional",
    "pisa-friction", "pisa-hydraulic", "nasa-faults", "nasa-flight", "pisa-validation",
    "pisa-commutation",
)  # fmt: skip


def main(arguments: list[str]) -> int:
    """Write, or check, the records of the cases named; all of them by default."""
    check = "--check" in arguments
    wrong = 0
    for name in [word for word in arguments if word != "--check"] or CASES:
        checks = checks_of(name)
        kept = RUNS / f"{name}.json"
        if check:
            same = json.loads(kept.read_text("utf-8"))["checks"] == checks
            print(f"{name}: {'the same' if same else 'DIFFERENT'}", flush=True)
            wrong += not same
        else:
            kept.write_text(json.dumps(record(name, checks), indent=1) + "\n", "utf-8")
            print(f"{name}: {len(checks)} checks", flush=True)
    return 1 if wrong else 0


def checks_of(name: str) -> list[dict[str, object]]:
    """Run a case and return its checks."""
    words = [sys.executable, "-m", "elevon", "reproduce", name, "--json"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{name}: exit {done.returncode}\n{done.stderr}")
    return list(json.loads(done.stdout)["checks"])


def record(name: str, checks: list[dict[str, object]]) -> dict[str, object]:
    """Return what is kept of a run."""
    words = ["git", "rev-parse", "--short=7", "HEAD"]
    commit = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return {
        "command": f"elevon reproduce {name}",
        "date": datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        "commit": commit.strip(),
        "checks": checks,
    }


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
