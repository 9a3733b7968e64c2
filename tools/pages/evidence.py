"""Evidence: pages of the records of runs, with the day, the commit and the command of each."""

import csv
import json
from collections.abc import Iterator
from pathlib import Path

from records import code, plain, table

from elevon_cases.catalogue import PublishedWork, published, works


def pages(root: Path) -> Iterator[tuple[str, str]]:
    """Yield name and text of each page."""
    runs = root / "docs" / "evidence" / "runs"
    yield "evidence/judged-runs.md", judged(runs / "judged.csv")
    yield "evidence/published-cases.md", cases(sorted(runs.glob("*.json")))
    yield "evidence/published-items.md", items()


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
        rows = [cells(check) for check in run["checks"]]
        text += table(["check", "kind", "value", "limit", "the work's own", "passed"], rows) + "\n"
    return text


def items() -> str:
    """Return the page of every table and figure of the works, with the command that makes it."""
    text = (
        "# Every published table and figure\n\nWhat the works print, item by item, and the command "
        "that makes it, or why none does. `elevon reproduce --all --out DIR` runs every case.\n\n"
    )
    for work in works():
        made = [item for item in work.items if item.commands]
        compared = sum(item.compared for item in made)
        rows = [
            [plain(i.name), plain(i.text), ", ".join(map(code, i.commands)), plain(i.why)]
            for i in work.items
        ]
        head = ["item", "what it shows", "command", "why none, or what differs"]
        text += (
            f"## {plain(work.title)}\n\nOf {len(rows)}, {compared} are made by a command and "
            f"compared with what is printed, {len(made) - compared} are made and not compared.\n\n"
        )
        text += f"{table(head, rows)}\n{sections(work)}"
    return text


def sections(work: PublishedWork) -> str:
    """Return the list of cases that recompute what a work says in its text."""
    lines = [
        f"* {judged.item.partition(' ')[2]}: {code(f'elevon reproduce {record.name}')}"
        for record in published().values()
        for judged in record.checks
        if judged.item.startswith(f"{work.name} Section")
    ]
    unique = "\n".join(dict.fromkeys(lines))
    return f"Of the text:\n\n{unique}\n\n" if lines else ""


def cells(check: dict[str, object]) -> list[str]:
    """Return a check as a row of a page."""
    unit = f" {check['unit']}" if check.get("unit") else ""
    printed = "" if check.get("ours") is None else f"{check['ours']:.5g}{unit}"
    way = "at least" if check["at_least"] else "at most"
    passed = "yes" if check["passed"] else "no"
    name = plain(check["name"])
    kind = str(check.get("kind", "")).replace("_", " ")
    value = "no number" if check["value"] is None else f"{check['value']:.5g}{unit}"
    limit = f"{way} {check['limit']:.5g}"
    return [name, kind, value, limit, printed, passed]
