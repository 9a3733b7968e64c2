"""Cases in a process of their own: `python -m tests.fuzz.run COUNT [SEED [FORMAT ...]]`.

Prints one JSON object: outcomes by format, failures with how to see them again, the slowest case
and the process's greatest memory.
"""

from __future__ import annotations

import json
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from elevon.errors import ElevonError
from tests.fuzz.formats import FORMATS

__all__ = ["case", "main"]

LONGEST = 10.0  # s of processor time of a case: other processes must not count
_CLOCK = 100.0  # s, for a case that waits
_ADDRESSES = 8 * 2**30  # bytes: a case that takes all memory must not take the machine with it


class _Hung(BaseException):
    pass


def _stop(_signal: int, _frame: FrameType | None) -> None:
    raise _Hung


def case(name: str, seed: int, number: int, folder: Path) -> Path:
    """Write one case into an empty folder."""
    rng = np.random.default_rng([seed, number, *name.encode()])
    return FORMATS[name].write(folder, rng)


def outcome(name: str, path: Path) -> str:
    """Read a case: ``ok``, ``refused``, or what went wrong."""
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    signal.setitimer(signal.ITIMER_REAL, _CLOCK)
    try:
        FORMATS[name].read(path)
    except ElevonError as error:
        return "refused" if str(error).strip() else "an error without a word"
    except _Hung:
        return "hung: " + traceback.format_exc(limit=-3)
    except Exception as error:  # noqa: BLE001 - any other is what is looked for
        last = traceback.extract_tb(error.__traceback__)
        ours = [f for f in last if "elevon" in f.filename] or last
        where = f"{Path(ours[-1].filename).name}:{ours[-1].lineno}"
        return f"{type(error).__name__} at {where}: {str(error)[:200]}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    return "ok"


def run(names: list[str], count: int, seed: int) -> dict[str, Any]:
    """Run `count` cases of each format."""
    seen: dict[str, Counter[str]] = {name: Counter() for name in names}
    failures: list[str] = []
    slowest = (0.0, "")
    for name in names:
        _warm(name, seed)
        for number in range(count):
            with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
                path = case(name, seed, number, Path(folder))
                begin = time.process_time()
                result = outcome(name, path)
                took = time.process_time() - begin
            slowest = max(slowest, (took, f"{name} {seed} {number}"))
            known = result in {"ok", "refused"}
            seen[name][result if known else "failed"] += 1
            if not known:
                failures.append(f"{name} seed {seed} case {number}: {result}")
    return {"seen": seen, "failures": failures, "slowest": slowest, "peak_bytes": _peak()}


def _peak() -> int:
    """Return the most memory [byte] of this process; `ru_maxrss` begins with its parent's."""
    status = Path("/proc/self/status")
    if status.is_file():
        line = next(x for x in status.read_text().splitlines() if x.startswith("VmHWM:"))
        return 1024 * int(line.split()[1])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _warm(name: str, seed: int) -> None:
    """Read one case beforehand: imports are not a case's own time."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        outcome(name, case(name, seed, 0, Path(folder)))


def main(arguments: list[str]) -> int:
    """Run cases and print what came of them."""
    count, seed = int(arguments[0]), int(arguments[1]) if len(arguments) > 1 else 0
    signal.signal(signal.SIGALRM, _stop)
    signal.signal(signal.SIGPROF, _stop)
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESSES, _ADDRESSES))
    warnings.simplefilter("ignore")
    sys.stdout.write(json.dumps(run(arguments[2:] or list(FORMATS), count, seed)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
