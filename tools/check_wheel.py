"""Install the newest wheel of a folder where there is no compiler; use it without and with extras.

Run by `make wheel`. Needs a package index, as every `pip install` does.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

MOST_MB = 130
# What is part of every environment and not of the installation.
NOT_OURS = ("pip", "setuptools", "wheel", "_distutils_hack", "pkg_resources")


def main(folder: str) -> int:
    """Check the newest wheel of a folder; return the exit code."""
    wheel = max(Path(folder).resolve().glob("elevon-*.whl"), key=lambda path: path.stat().st_mtime)
    with tempfile.TemporaryDirectory() as temporary:
        home = Path(temporary)
        venv.create(home / "env", with_pip=True)
        scripts = home / "env" / ("Scripts" if os.name == "nt" else "bin")
        # Nothing of the caller's: no cargo, no compiler, no package beside it.
        keep = {
            "HOME",
            "SYSTEMROOT",
            "TEMP",
            "TMP",
            "LANG",
            "PIP_INDEX_URL",
            "PIP_CERT",
            "SSL_CERT_FILE",
        }
        environment = {key: value for key, value in os.environ.items() if key in keep}
        environment["PATH"] = str(scripts)

        def run(*words: str, fails: bool = False) -> str:
            done = subprocess.run(
                words, cwd=home, env=environment, capture_output=True, text=True, check=False
            )
            if (done.returncode != 0) != fails:
                raise SystemExit(f"{' '.join(words)}: exit {done.returncode}\n{done.stderr}")
            return done.stdout + done.stderr

        python, elevon = str(scripts / "python"), str(scripts / "elevon")
        run(python, "-m", "pip", "install", "--quiet", "--only-binary", ":all:", str(wheel))
        where = run(python, "-c", "import elevon; print(elevon.__path__[0])").strip()
        size = _megabytes(Path(where).parent)
        print(f"{wheel.name}: {wheel.stat().st_size / 2**20:.1f} MB, installed {size:.0f} MB")
        if size > MOST_MB:
            raise SystemExit(f"the installation takes {size:.0f} MB; at most {MOST_MB}")
        run(elevon, "list", "actuators")
        run(elevon, "show", "torino-rotary")
        run(elevon, "simulate", "torino-rotary", "--duration", "0.2", "--out", "run.csv")
        run(elevon, "export", "fmu", "torino-rotary", "-o", "a.fmu")
        run(elevon, "bench", "run", "stall", "--actuator", "torino-rotary", "--out", "bench")
        run(python, "-c", SESSION)
        output = run(
            elevon,
            "simulate",
            "torino-rotary",
            "--duration",
            "0.1",
            "--out",
            "run.parquet",
            fails=True,
        )
        if f"elevon[files] @ {wheel.as_uri()}" not in output:
            raise SystemExit(f"a command without its extra does not name it: {output}")
        print("simulate, list, show, export, bench, sessions, CSV: without extras and a compiler")
        everything = f"elevon[all] @ {wheel.as_uri()}"
        run(python, "-m", "pip", "install", "--quiet", "--only-binary", ":all:", everything)
        unit = ("--actuator", "torino-rotary")
        run(elevon, "simulate", "torino-rotary", "--duration", "0.1", "--out", "run.parquet")
        run(elevon, "simulate", "torino-rotary", "--duration", "0.1", "--plot", "run.html")
        run(elevon, "bench", "run", "chirp", *unit, "--fidelity", "low", "--out", "logs")
        run(elevon, "diagnose", "logs/chirp.csv", *unit, "--baseline", "logs/chirp.csv")
        print("Parquet, pictures, diagnosis: with all extras, without a compiler")
    return 0


SESSION = """
import elevon
session = elevon.Session("nasa-ballscrew")
session.set(command="1 mm")
(recording,) = session.run("20 ms")
recording.save("session.csv")
assert elevon.Recording.load("session.csv").equals(recording)
"""


def _megabytes(packages: Path) -> float:
    files = (path for path in packages.rglob("*") if path.is_file() and not path.is_symlink())
    ours = (f for f in files if not f.relative_to(packages).parts[0].startswith(NOT_OURS))
    return sum(path.stat().st_size for path in ours) / 2**20


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else "dist"))
