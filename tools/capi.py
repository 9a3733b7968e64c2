"""Build the C interface and put its shared library where the package looks for the binary of FMUs.

Run by `make setup`, `make capi` and `make wheel`, and by whoever builds a wheel elsewhere. The core
is compiled once for the extension and this: same profile, same features.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "python" / "elevon" / "deploy" / "lib"
NAMES = {
    "linux": ("libelevon.so", "elevon.so"),
    "darwin": ("libelevon.dylib", "elevon.dylib"),
    "win32": ("elevon.dll", "elevon.dll"),
}


def main(words: list[str]) -> int:
    """Build with cargo (further words go to it) and copy; return the exit code."""
    build = ["cargo", "build", "--release", "--locked", "--quiet", "--package", "elevon-capi"]
    done = subprocess.run([*build, *words], cwd=ROOT, check=False)
    if done.returncode != 0:
        return done.returncode
    built, name = NAMES[sys.platform]
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    folder = target / words[words.index("--target") + 1] if "--target" in words else target
    FOLDER.mkdir(exist_ok=True)
    temporary = FOLDER / f".{name}"
    shutil.copy(folder / "release" / built, temporary)
    if strip := shutil.which("strip"):
        # The functions stay: they are the library's interface.
        subprocess.run([strip, "-x" if sys.platform == "darwin" else "--strip-unneeded", temporary],
                       check=False)  # fmt: skip
    temporary.replace(FOLDER / name)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
