"""Build and run the C yardsticks beside this file."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCALAR = ["-O3", "-march=native"]
LANES = [*SCALAR, "-fno-trapping-math", "-fno-math-errno", "-fopenmp-simd"]


@dataclass(frozen=True)
class Yardstick:
    """One built C program."""

    path: Path
    flags: tuple[str, ...]

    def run(self, steps: int, repeats: int = 1, record_every: int = 2500) -> dict[str, float]:
        """Run it and read its ``name=value`` line."""
        command = [str(self.path), str(steps), str(repeats), str(record_every)]
        line = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return {name: float(value) for name, value in (pair.split("=") for pair in line.split())}


def cpu_flags() -> list[str]:
    """Vector extensions of this CPU that matter here (Linux; empty elsewhere)."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return []
    known = ("sse2", "avx", "avx2", "fma", "avx512f", "avx512dq", "asimd")
    line = next((x for x in text.splitlines() if x.startswith(("flags", "Features"))), "")
    return [name for name in known if name in line.split()]


def cpu_model() -> str:
    """Name of the CPU as the system prints it."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return "unknown"
    line = next((x for x in text.splitlines() if x.startswith("model name")), "unknown: unknown")
    return line.split(":", 1)[1].strip()


def compiler() -> str:
    """The C compiler, ``CC`` first."""
    found = (
        os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    )
    if not found:
        raise SystemExit("benchmarks: no C compiler found (set CC); the yardsticks cannot be built")
    return found


def build(folder: Path) -> dict[str, Yardstick]:
    """Compile every yardstick into `folder`.

    Returns ``c`` (libm sines), ``c_poly`` (polynomial sines), ``c_count`` (counts transitions, not
    for timing) and ``c_batch`` (64 lanes).
    """
    wide = ["-mprefer-vector-width=512"] if "avx512f" in cpu_flags() else []
    recipes = {
        "c": ("benchmark_job.c", SCALAR),
        "c_poly": ("benchmark_job.c", [*SCALAR, "-DFASTTRIG"]),
        "c_count": ("benchmark_job.c", [*SCALAR, "-DCOUNT"]),
        "c_batch": ("benchmark_lanes.c", [*LANES, *wide]),
    }
    built = {}
    for name, (source, flags) in recipes.items():
        target = folder / name
        subprocess.run(
            [compiler(), *flags, str(HERE / source), "-o", str(target), "-lm"], check=True
        )
        built[name] = Yardstick(target, tuple(flags))
    return built
