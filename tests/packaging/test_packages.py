"""The packages: the sdist holds what a wheel is built of, the wheel works where nothing else is."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import check_wheel  # noqa: E402

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
#: The optimised build takes a quarter of an hour; what is in the package is the same.
QUICK = {"MATURIN_PEP517_ARGS": "--locked --profile physics --features physics"}


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_runs_what_exists(path):
    text = path.read_text("utf-8")
    commands = re.findall(r"run: (.+)", text)
    assert commands
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.M))
    for command in commands:
        for target in re.findall(r"\bmake ([a-z-]+)", command):
            assert target in targets, command
        for script in re.findall(r"(?:bash|python) (\S+)", command):
            assert (ROOT / script).is_file(), command
    for step in re.findall(r"uses: (\S+)", text):
        assert re.search(r"@[0-9a-f]{40}$", step), f"{step}: not pinned to a commit"


@pytest.mark.parametrize("job", ["wheel", "source"])
def test_each_build_writes_its_commit(job):
    """Before the packages are built: `elevon --version` of an installation has no git to ask."""
    text = (ROOT / ".github/workflows/wheels.yml").read_text("utf-8")
    steps = text.partition(f"\n  {job}:\n")[2].partition("maturin-action@")[0]
    assert "git rev-parse --short=12 HEAD > python/elevon/cli/commit.txt" in steps


def _copy(folder):
    """Copy what git tracks, and a commit, as `make sdist` writes it."""
    git = ["git", "-C", str(ROOT)]
    names = subprocess.run([*git, "ls-files", "-z"], capture_output=True, text=True, check=True)
    for name in filter(None, names.stdout.split("\0")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    commit = [*git, "rev-parse", "--short=12", "HEAD"]
    done = subprocess.run(commit, capture_output=True, text=True, check=True)
    (folder / "python/elevon/cli/commit.txt").write_text(done.stdout, "utf-8")
    return done.stdout.strip()


@pytest.mark.skipif(shutil.which("cargo") is None, reason="no cargo")
def test_the_sdist_holds_every_file_of_the_package(tmp_path):
    """Tables and pages, too: a wheel is built of nothing else."""
    maturin = Path(sys.executable).with_name("maturin")
    subprocess.run([maturin, "sdist", "--out", tmp_path], cwd=ROOT, check=True, capture_output=True)
    (archive,) = tmp_path.glob("elevon-*.tar.gz")
    with tarfile.open(archive) as packed:
        names = {name.partition("/")[2] for name in packed.getnames()}
    git = ["git", "-C", str(ROOT), "ls-files", "-z", "python"]
    tracked = subprocess.run(git, capture_output=True, text=True, check=True).stdout.split("\0")
    assert [name for name in tracked if name and name not in names] == []


@pytest.fixture
def index(tmp_path):
    """A package index within reach: nothing can be installed without one."""
    ask = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", tmp_path]
    done = subprocess.run([*ask, "typer"], capture_output=True, check=False)
    if done.returncode:
        pytest.skip("no package index can be reached")


@pytest.mark.long
@pytest.mark.usefixtures("index")
@pytest.mark.skipif(shutil.which("cargo") is None, reason="no cargo")
def test_the_sdist_builds_a_wheel_that_works_alone(tmp_path, capsys):
    """Without compiler, without and with extras; with the commit."""
    tree, dist = tmp_path / "tree", tmp_path / "dist"
    commit = _copy(tree)
    maturin = Path(sys.executable).with_name("maturin")
    subprocess.run([maturin, "sdist", "--out", dist], cwd=tree, check=True, capture_output=True)
    (archive,) = dist.glob("elevon-*.tar.gz")
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    target = os.environ.get("CARGO_TARGET_DIR", str(ROOT / "target"))
    environment = {**os.environ, **QUICK, "CARGO_TARGET_DIR": target}
    environment.pop("PYTHONPATH", None)
    command = [*pip, "--wheel-dir", dist, archive]
    subprocess.run(command, cwd=tmp_path, env=environment, check=True)
    (wheel,) = dist.glob("elevon-*.whl")
    assert check_wheel.main([str(wheel), "--from-sdist"]) == 0
    printed = capsys.readouterr().out
    with capsys.disabled():
        sys.stdout.write(f"\n{printed}")
    assert f"({commit})" in printed
