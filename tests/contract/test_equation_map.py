"""The map from the papers to the files names files that exist, for every paper."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "explanation" / "equations.md"
ROWS = re.findall(
    r"^\| ([TNP]\d?[^|]*) \| ([^|]+) \| (?:\[`[^`]+`\]\(([^)]+)\)|`([^`]+)`) \|$",
    PAGE.read_text(encoding="utf-8"),
    flags=re.MULTILINE,
)


@pytest.mark.parametrize(("paper", "what", "link", "file"), ROWS)
def test_the_file_exists(paper: str, what: str, link: str, file: str) -> None:
    core = ROOT / "crates" / "elevon-core" / "src"
    assert ((PAGE.parent / link) if link else core / file).exists(), f"{paper}, {what}"


def test_every_paper_is_mapped() -> None:
    named = " ".join(row[0] for row in ROWS)
    assert all(re.search(rf"\b{paper}\b", named) for paper in ("T1", "T2", "T3", "N", "P"))
