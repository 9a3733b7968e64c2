"""Files of our own formats with anything in them: read, or refused by an error of the family.

No other exception, no hang, and memory that does not follow what a file promises.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from elevon.campaign.store import Manifest, shape_error
from elevon.errors import FormatError, InputError
from tests.fuzz.formats import FORMATS
from tests.fuzz.mutate import Raw, changed, to_json, to_toml

#: Bytes that the process may take, the libraries among them.
MEMORY = 10**9
#: Cases of each format in the sample that always runs, and in the long one: 20 000 in all.
FEW, MANY = 12, -(-20_000 // len(FORMATS))


@pytest.mark.parametrize(
    "count", [FEW, pytest.param(MANY, marks=pytest.mark.long)], ids=["few", "many"]
)
def test_every_file_is_read_or_refused(count: int) -> None:
    """In a process of its own, whose memory is counted; some of each format are read."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz.run", str(count), "11"],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    result = json.loads(done.stdout)
    assert result["failures"] == []
    assert result["peak_bytes"] < MEMORY
    assert set(result["seen"]) == set(FORMATS)
    for name, seen in result["seen"].items():
        assert sum(seen.values()) == count
        if count > FEW:
            assert set(seen) == {"ok", "refused"}, name


def test_changes_leave_the_document_alone_and_are_those_of_their_seed() -> None:
    document = {"a": [1, {"b": "c"}], "d": 2.0}
    made = [to_json(changed(document, np.random.default_rng(k))) for k in range(50)]
    assert made == [to_json(changed(document, np.random.default_rng(k))) for k in range(50)]
    assert document == {"a": [1, {"b": "c"}], "d": 2.0}
    assert len(set(made)) > 25


def test_what_no_writer_writes_stands_in_the_file() -> None:
    digits = "9" * 5000
    assert to_json({"a": [Raw(digits), None]}) == f'{{"a":[{digits},null]}}'
    assert to_toml({"a": [Raw(digits), True, "x"]}) == f'"a" = [{digits}, true, "x"]\n'


DEEP, LONG = "[" * 20_000 + "]" * 20_000, "9" * 5000


@pytest.mark.parametrize(
    ("name", "file", "text"),
    [
        ("scenario", "a.toml", 'command.terms = [{kind = "table", file = "\\u0000"}]'),
        ("scenario", "a.toml", f"duration = {DEEP}\n"),
        ("scenario", "a.toml", f"duration = {LONG}\n"),
        ("note", "a.json", f'{{"waveform": "sine", "amplitude": {LONG[:400]}}}'),
        ("note", "a.json", '{"command": {"mode": "position", "terms": 5}}'),
        ("calibration", "a.toml", f'base = "{LONG}"\n'),
        ("result", "a.json", f'{{"hypotheses": {DEEP}}}'),
        ("result", "a.json", f'{{"hypotheses": {LONG}}}'),
    ],
)
def test_what_once_ended_in_a_traceback_is_refused(
    tmp_path: Path, name: str, file: str, text: str
) -> None:
    path = tmp_path / file
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError):
        FORMATS[name].read(path)


def test_a_history_with_a_number_too_long_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(f'{{"usage": {LONG}}}', encoding="utf-8")
    with pytest.raises(FormatError):
        FORMATS["history"].read(tmp_path)


@pytest.mark.parametrize(
    ("field", "value", "place"),
    [
        ("total", -1, "total"),
        ("files", {"../../x": {"bytes": 1, "sha256": "0" * 64}}, "files"),
        ("files", {"runs.parquet": {"bytes": 1, "sha256": 5}}, "files.runs.parquet.sha256"),
        ("blocks", [{"name": "block", "first": 0, "last": "a", "files": {}}], "blocks.0.last"),
        ("clocks", [5], "clocks.0"),
    ],
)
def test_a_manifest_whose_fields_are_of_another_form_is_refused_by_name(
    field: str, value: object, place: str
) -> None:
    whole = Manifest("n", "0" * 64, 1, [0, 1], "0", "0")
    assert shape_error(Manifest, vars(whole)) is None
    found = shape_error(Manifest, {**vars(whole), field: value})
    assert found is not None
    assert found.startswith((f"{place}:", f"{place}."))
