"""Install a wheel where there is no compiler; use it without and with extras, then with the cases.

    python tools/check_wheel.py dist              the newest wheel of a folder
    python tools/check_wheel.py A.whl --from-sdist    made of the source distribution: no FMU binary

With extras README and the tutorial are run as a newcomer does (`tools/newcomer.py`). Where the
wheel of the published cases lies beside it, both together are used, too. Run by `make wheel` and
`make sdist`. Prints the seconds from nothing to the first picture. Needs a package index, as every
`pip install` does.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import venv
import zipfile
from pathlib import Path

import newcomer

MOST_MB = 130
# What is part of every environment and not of the installation.
NOT_OURS = ("pip", "setuptools", "wheel", "_distutils_hack", "pkg_resources")
# Nothing of the caller's: no cargo, no compiler, no package beside it.
PASSED_ON = ("HOME", "SYSTEMROOT", "TEMP", "TMP", "LANG", "SSL_CERT_FILE")
INSTALL = ("-m", "pip", "install", "--quiet", "--only-binary", ":all:")
TURN = ("simulate", "torino-rotary", "--duration", "0.1")
PAGES = ("README.md", "docs/start/tutorial.md")
SESSION = """
import elevon
session = elevon.Session("nasa-ballscrew")
session.set(command="1 mm")
(recording,) = session.run("20 ms")
recording.save("session.csv")
assert elevon.Recording.load("session.csv").equals(recording)
"""


class Place:
    """A folder with an environment of its own, and the seconds of what it has run."""

    def __init__(self, folder: Path) -> None:
        began = time.monotonic()
        self.folder = folder
        venv.create(folder / "env", with_pip=True)
        self.scripts = folder / "env" / ("Scripts" if os.name == "nt" else "bin")
        passed = {k: v for k, v in os.environ.items() if k in PASSED_ON or k.startswith("PIP_")}
        self.environment = {**passed, "PATH": str(self.scripts)}
        self.seconds = time.monotonic() - began

    def run(self, name: str, *words: str, fails: bool = False) -> str:
        """Run a program of the environment; return what it printed."""
        began = time.monotonic()
        done = subprocess.run(
            [str(self.scripts / name), *words], cwd=self.folder, env=self.environment,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        self.seconds += time.monotonic() - began
        if (done.returncode != 0) != fails:
            raise SystemExit(f"{name} {' '.join(words)}: exit {done.returncode}\n{done.stderr}")
        return done.stdout + done.stderr


def main(arguments: list[str]) -> int:
    """Check a wheel; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wheel", nargs="?", type=Path, default=Path("dist"))
    parser.add_argument("--from-sdist", action="store_true", help="the binary of FMUs is not in it")
    options = parser.parse_args(arguments)
    wheel = options.wheel.resolve()
    if wheel.is_dir():
        wheel = max(wheel.glob("elevon-*.whl"), key=lambda path: path.stat().st_mtime)
    if "-cp311-abi3-" not in wheel.name:
        raise SystemExit(f"{wheel.name}: not for every Python from 3.11 on (cp311-abi3)")
    with tempfile.TemporaryDirectory() as folder:
        bare(Place(Path(folder)), wheel, fmus=not options.from_sdist)
    with tempfile.TemporaryDirectory() as folder:
        place = Place(Path(folder))
        everything(place, wheel)
        for cases in sorted(wheel.parent.glob("elevon_cases-*.whl"))[-1:]:
            published(place, wheel, cases)
    return 0


def bare(place: Place, wheel: Path, *, fmus: bool) -> None:
    """What works without extras, and what names the extra that it lacks."""
    place.run("python", *INSTALL, str(wheel))
    where = place.run("python", "-c", "import elevon; print(elevon.__path__[0])").strip()
    size = _megabytes(Path(where).parent)
    print(f"{wheel.name}: {wheel.stat().st_size / 2**20:.1f} MB, installed {size:.0f} MB")
    if size > MOST_MB:
        raise SystemExit(f"the installation takes {size:.0f} MB; at most {MOST_MB}")
    version = place.run("elevon", "--version").strip()
    if not re.search(r"\([0-9a-f]{12}\)$", version):
        raise SystemExit(f"elevon --version prints {version!r}: no commit of twelve digits")
    place.run("elevon", "list", "actuators")
    place.run("elevon", "show", "torino-rotary")
    place.run("elevon", *TURN, "--out", "run.csv")
    place.run("elevon", "export", "fmu", "torino-rotary", "-o", "a.fmu", fails=not fmus)
    place.run("elevon", "bench", "run", "stall", "--actuator", "torino-rotary", "--out", "bench")
    place.run("python", "-c", SESSION)
    output = place.run("elevon", *TURN, "--out", "run.parquet", fails=True)
    if f"elevon[files] @ {wheel.as_uri()}" not in output:
        raise SystemExit(f"a command without its extra does not name it: {output}")
    print(f"{version}: works without extras and without a compiler")


def everything(place: Place, wheel: Path) -> None:
    """The seconds from nothing to the first picture; what the extras are for."""
    place.run("python", *INSTALL, f"elevon[all] @ {wheel.as_uri()}")
    place.run("elevon", *TURN, "--plot", "run.html")
    print(f"from nothing to the first picture: {place.seconds:.0f} s")
    unit = ("--actuator", "torino-rotary")
    place.run("elevon", *TURN, "--out", "run.parquet")
    place.run("elevon", "bench", "run", "chirp", *unit, "--fidelity", "low", "--out", "logs")
    place.run("elevon", "diagnose", "logs/chirp.csv", *unit, "--baseline", "logs/chirp.csv")
    print("Parquet, pictures, diagnosis: with all extras, without a compiler")
    os.environ.pop("PYTHONPATH", None)  # the source tree must not stand in for what was installed
    wrong = sum(newcomer.run_page(newcomer.ROOT / page, place.scripts) for page in PAGES)
    if wrong:
        raise SystemExit(f"{wrong} blocks of {' and '.join(PAGES)} fail or print something else")


def published(place: Place, wheel: Path, cases: Path) -> None:
    """No case is part of the product; both wheels together recompute one."""
    foreign = [name for name in _names(wheel) if "reproduce" in name or "elevon_cases" in name]
    if foreign:
        raise SystemExit(f"{wheel.name} has published cases: {', '.join(foreign)}")
    if not {"elevon_cases/cases.toml", "elevon_cases/catalogue/cases.toml"} <= _names(cases):
        raise SystemExit(f"{cases.name}: its tables are missing")
    # Of an environment with the product alone.
    output = place.run("elevon", "reproduce", "torino-compliance", "--json", fails=True)
    if "pip install elevon-cases" not in output:
        raise SystemExit(f"a command of another package does not name it: {output}")
    place.run("python", *INSTALL, "--no-deps", str(cases))
    place.run("python", "-m", "pip", "check")
    place.run("elevon", "reproduce", "torino-backlash", "--out", "backlash")
    print(f"{cases.name}: recomputes a published table beside the product's wheel")


def _names(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def _megabytes(packages: Path) -> float:
    files = (path for path in packages.rglob("*") if path.is_file() and not path.is_symlink())
    ours = (f for f in files if not f.relative_to(packages).parts[0].startswith(NOT_OURS))
    return sum(path.stat().st_size for path in ours) / 2**20


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
