"""Evidence: pages of the records of runs, with the day, the commit and the command of each."""

import csv
import json
from collections.abc import Iterator
from pathlib import Path

from records import code, plain, table


def pages(root: Path) -> Iterator[tuple[str, str]]:
    """Yield name and text of each page."""
    runs = root / "docs" / "evidence" / "runs"
    yield "evidence/judged-runs.md", judged(runs / "judged.csv")
    yield "evidence/published-cases.md", cases(sorted(runs.glob("*.json")))


def judged(path: Path) -> str:
    """Return the page of the judged runs."""
    lines = [line for line in path.read_text("utf-8").splitlines() if not line.startswith("#")]
    rows = [
        [code(row["command"]), row["date"], code(row["commit"]), f"[figures]({row['page']})"]
        for row in csv.DictReader(lines)
    ]
    return (
        "# Judged runs\n\nRuns on seeds that nobody had looked at, each done once, with the commit "
        f"that recorded what it printed.\n\n{table(['command', 'date', 'commit', ''], rows)}"
    )


def cases(paths: list[Path]) -> str:
    """Return the page of the published cases: each check as the command printed it."""
    text = (
        "# Published cases, check by check\n\nAs the commands wrote it; `python tools/evidence.py` "
        "runs them again. What each case is: [recomputing](reproduce.md).\n\n"
    )
    for path in paths:
        run = json.loads(path.read_text("utf-8"))
        text += (
            f"## {path.stem}\n\n`{run['command']}`, {run['date']}, commit `{run['commit']}`.\n\n"
        )
        head = list(run["checks"][0])
        rows = [[cell(check[key]) for key in head] for check in run["checks"]]
        text += table([plain(key) for key in head], rows) + "\n"
    return text


def cell(value: object) -> str:
    """Return a value of a check as a page shows it."""
    return f"{value:.5g}" if isinstance(value, float) else plain(value)
