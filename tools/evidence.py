"""Run the commands behind the evidence, keep what they wrote: `python tools/evidence.py [NAME]`.

    python tools/evidence.py torino-drops               runs `elevon reproduce torino-drops`
    python tools/evidence.py NAME --command "..."       runs another command that prints `checks`
    python tools/evidence.py NAME --command "..." --printed FILE    keeps what it printed elsewhere
    python tools/evidence.py --check [NAME]             runs again and compares, writes nothing
    python tools/evidence.py --pages                    writes the records into the pages

Each record, docs/evidence/runs/NAME.json, has the command, the day, the commit and the checks as
the command printed them. A page shows one between `<!-- run NAME -->` (a sentence) or
`<!-- checks NAME -->` (a table), or `<!-- determined NAME -->` (of a real machine, what was
determined and predicted) and `<!-- end -->`; `make docs` makes a page of all of them.
`<!-- judged NAME -->` stands for the last row of runs/judged.csv whose command has that word.
"""

import argparse
import csv
import datetime
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = ROOT / "docs" / "evidence"
RUNS = PAGES / "runs"
#: Published cases that need no foreign data and take at most some minutes.
CASES = (
    "torino-backlash", "torino-compliance", "torino-validation", "torino-loaded", "torino-drops",
    "torino-fmeca", "torino-gear", "low-fidelity", "nasa-current", "nasa-thermal",
    "pisa-functional", "pisa-friction", "pisa-hydraulic", "nasa-faults", "nasa-flight",
    "pisa-validation", "pisa-commutation",
)  # fmt: skip
#: What is kept of a real machine beside its checks.
REAL = ("rows", "predictions", "source", "licence", "sha256")
BLOCK = re.compile(
    r"^<!-- (run|checks|determined|judged) (\S+) -->\n.*?^<!-- end -->$", re.M | re.S
)


def main(arguments: list[str]) -> int:
    """Write, or check, the records of the cases named; all published ones by default."""
    options = _options(arguments)
    wrong = 0
    for name in [] if options.pages else options.names or CASES:
        command = options.command or f"elevon reproduce {name}"
        if options.check:
            same = run_again(name)
            print(f"{name}: {'the same' if same else 'DIFFERENT'}", flush=True)
            wrong += not same
        else:
            printed = options.printed.read_text("utf-8") if options.printed else _printed(command)
            found = json.loads(printed)
            checks = list(found["checks"])
            more = {key: found[key] for key in REAL if "predictions" in found}
            text = json.dumps(record(command, checks) | more, indent=1)
            (RUNS / f"{name}.json").write_text(text + "\n", "utf-8")
            print(f"{name}: {len(checks)} checks", flush=True)
    if not options.check:
        for path in sorted(PAGES.glob("*.md")):
            path.write_text(filled(path.read_text("utf-8")), "utf-8")
    return 1 if wrong else 0


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--check", action="store_true", help="run again and compare")
    parser.add_argument("--pages", action="store_true", help="write the records into the pages")
    parser.add_argument("--command", help="what was run, if not `elevon reproduce NAME`")
    parser.add_argument("--printed", type=Path, help="what that command printed with --json")
    options = parser.parse_args(arguments)
    if (options.command or options.printed) and (len(options.names) != 1 or options.check):
        parser.error("--command and --printed are of one record, which is written")
    return options


def kept(name: str) -> dict[str, object]:
    """Return a record."""
    return dict(json.loads((RUNS / f"{name}.json").read_text("utf-8")))


def run_again(name: str) -> bool:
    """Whether a record's command still writes what the record holds."""
    run = kept(name)
    return list(json.loads(_printed(str(run["command"])))["checks"]) == run["checks"]


def record(command: str, checks: list[dict[str, object]]) -> dict[str, object]:
    """Return what is kept of a run."""
    words = ["git", "rev-parse", "--short=7", "HEAD"]
    commit = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return {
        "command": command,
        "date": datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        "commit": commit.strip(),
        "checks": checks,
    }


def filled(text: str) -> str:
    """Return a page with its records as they are kept now."""
    return BLOCK.sub(lambda m: f"<!-- {m[1]} {m[2]} -->\n{_block(m[1], m[2])}<!-- end -->", text)


def _block(form: str, name: str) -> str:
    if form == "judged":
        return _judged(name)
    run = kept(name)
    if form == "determined":
        return _determined(run)
    checks = [dict(check) for check in run["checks"]]  # type: ignore[attr-defined]
    missed = [check for check in checks if not check["passed"]]
    text = f"`{run['command']}`, {run['date']}, commit `{run['commit']}`: "
    text += f"{_counts(checks)} pass.\n"
    if form == "checks":
        rows = [f"| {c['name']} | {_kind(c)} | {_value(c)} | {_limit(c)} | {_yes(c)} |"
                for c in checks]  # fmt: skip
        head = ["| check | kind | value | limit | passed |", "|---|---|---|---|---|"]
        return "\n".join([text, *head, *rows, ""])
    lines = [f"* not met: {c['name']}: {_value(c)} ({_limit(c)})" for c in missed]
    return "\n".join([text, *lines, ""]) if lines else text


def _determined(run: dict[str, object]) -> str:
    """Return the tables of a real machine: its numbers beside the authors', errors held out."""
    rows: list[dict[str, object]] = run["rows"]  # type: ignore[assignment]
    lines = ["| fit | quantity | value | 90 % interval | authors | off |", "|" + "---|" * 6]
    for row in rows:
        theirs = "" if row["printed"] is None else f"{row['printed']:.6g}"
        off = "" if row["off_percent"] is None else f"{row['off_percent']:+.2f} %"
        interval = f"{row['low']:.4g} to {row['high']:.4g}"
        number = f"{row['value']:.5g} {row['unit']}"
        quantity = str(row["quantity"]).replace("_", " ")
        lines.append(f"| {row['fit']} | {quantity} | {number} | {interval} | {theirs} | {off} |")
    lines += ["", "| fit | held-out log | signal | RMS error | % of range |", "|" + "---|" * 5]
    errors: list[dict[str, object]] = run["predictions"]  # type: ignore[assignment]
    for row in errors:
        if row["held_out"]:
            size, share = f"{row['rms']:.3g} {row['unit']}", f"{row['percent_of_range']:.2g}"
            signal = str(row["signal"]).replace("_", " ")
            lines.append(f"| {row['fit']} | {row['log']} | {signal} | {size} | {share} |")
    digits: dict[str, str] = run["sha256"]  # type: ignore[assignment]
    lines += ["", f"Data: {run['source']}. Licence: {run['licence']}. SHA-256:", ""]
    lines += [f"* `{name}` `{value}`" for name, value in digits.items()]
    return "\n".join([*lines, ""])


def _judged(name: str) -> str:
    lines = [
        line for line in (RUNS / "judged.csv").read_text("utf-8").splitlines() if line[:1] != "#"
    ]
    row = [row for row in csv.DictReader(lines) if name in row["command"].split()][-1]
    return f"`{row['command']}`, {row['date']}, commit `{row['commit']}`, run once.\n"


def _kind(check: dict[str, object]) -> str:
    """What a check is held against; a study's checks do not say."""
    return str(check.get("kind", "check")).replace("_", " ")


def _counts(checks: list[dict[str, object]]) -> str:
    """Return how many pass of each kind: kinds are never added."""
    kinds = dict.fromkeys(map(_kind, checks))
    found = {kind: [check["passed"] for check in checks if _kind(check) == kind] for kind in kinds}
    return ", ".join(f"{kind} {sum(map(bool, p))} of {len(p)}" for kind, p in found.items())


def _value(check: dict[str, object]) -> str:
    if check["value"] is None:
        return "no number"
    unit = f" {check['unit']}" if check.get("unit") else ""
    return f"{check['value']:.4g}{unit}"


def _limit(check: dict[str, object]) -> str:
    return f"at {'least' if check['at_least'] else 'most'} {check['limit']:.4g}"


def _yes(check: dict[str, object]) -> str:
    return "yes" if check["passed"] else "no"


def _printed(command: str) -> str:
    """Run a command with --json; return what it printed."""
    words = shlex.split(command)
    start = words[1:] if words[0] == "python" else ["-m", *words]
    done = subprocess.run(
        [sys.executable, *start, "--json"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if done.returncode not in (0, 1):
        raise SystemExit(f"{command}: exit {done.returncode}\n{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
