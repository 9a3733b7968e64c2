"""What a build brings in: pinned by hash or commit, under licences that are allowed."""

import importlib.util
import re
import shutil
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("licences", ROOT / "tools" / "licences.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_locked_package_has_hashes():
    text = (ROOT / "requirements.lock").read_text("utf-8")
    entries = [part for part in re.split(r"^(?=[A-Za-z0-9])", text, flags=re.M) if "==" in part]
    assert len(entries) > 50
    assert [entry for entry in entries if "--hash=sha256:" not in entry] == []
    makefile = (ROOT / "Makefile").read_text("utf-8")
    assert "--require-hashes -r requirements.lock" in makefile
    assert "--generate-hashes" in makefile


def test_actions_are_pinned_by_commit():
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        uses = re.findall(r"uses: (\S+)(.*)", path.read_text("utf-8"))
        assert uses
        for action, note in uses:
            assert re.fullmatch(r"[\w.-]+/[\w.-]+@[0-9a-f]{40}", action), action
            assert re.search(r"# v\d", note), action


def test_both_lists_of_licences_agree(tool):
    allowed = tomllib.loads((ROOT / "deny.toml").read_text("utf-8"))["licenses"]["allow"]
    assert set(allowed) <= tool.ALLOWED


@pytest.mark.parametrize(
    ("licence", "good"),
    [
        ("MIT", True), ("MIT OR Apache-2.0", True), ("MIT/Apache-2.0", True),
        ("GPL-3.0-only", False), ("MIT OR GPL-3.0-only", True), ("MIT AND GPL-3.0-only", False),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", True), ("(MIT OR Apache-2.0) AND GPL-2.0", False),
        ("Apache-2.0 WITH LLVM-exception", True), ("unknown", False), ("", False), ("(MIT", False),
    ],
)  # fmt: skip
def test_a_licence_is_judged_by_its_expression(tool, licence, good):
    assert tool.allowed(licence) is good


def test_what_may_only_be_optional(tool):
    assert tool.finding("moocore", "LGPL-2.1-or-later", default=False) == ""
    assert "default installation" in tool.finding("moocore", "LGPL-2.1-or-later", default=True)
    assert tool.finding("other", "LGPL-2.1-or-later", default=False)


@pytest.mark.skipif(shutil.which("cargo") is None, reason="needs cargo for the list of crates")
def test_every_dependency_has_an_allowed_licence(tool, capsys):
    assert tool.main() == 0
    listed = capsys.readouterr().out
    for name in ("numpy", "pydantic", "moocore", "pyo3", "ndarray"):
        assert re.search(rf"^{name} ", listed, re.M), name
    assert "moocore" not in tool.installed_by_default()
