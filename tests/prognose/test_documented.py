"""The Python examples of docs/explanation/prognosis.md run as written."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAW, PROGPY = re.findall(
    r"^```python\n(.*?)^```",
    (ROOT / "docs/explanation/prognosis.md").read_text("utf-8"),
    re.M | re.S,
)


def test_a_law_of_ones_own(monkeypatch):
    monkeypatch.chdir(ROOT)
    names = {}
    exec(LAW, names)
    result = names["result"]
    assert result.known[0].law == "creep"
    assert result.known[0].severity == pytest.approx(0.006, rel=0.1)
    assert 0.0 < result.interval[0] < result.median < result.interval[1] < 20_000.0


@pytest.mark.filterwarnings("ignore")
def test_the_actuator_as_a_model_of_progpy(monkeypatch):
    pytest.importorskip("progpy")
    monkeypatch.chdir(ROOT)
    names = {}
    exec(PROGPY, names)
    assert min(names["result"].event_states[-1].values()) == pytest.approx(0.0, abs=0.02)
    assert len(names["units"]) == 2000
