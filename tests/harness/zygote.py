"""A process that has imported the package and forks once for each run of a command.

Started with the shim preloaded; reads one JSON object a line from standard input: ``root`` (the
folder whose files count), ``jobs`` (each: ``argv``, ``out``: where its streams go, ``mode``,
``at``) and ``limit`` (s of processor time). All jobs of a line run at once. Answers with one line:
the exit codes (negative: the signal; None: still running after the limit).
"""

import ctypes
import importlib
import json
import os
import pkgutil
import signal
import sys
import time
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
_CLOCK = 10.0  # a busy machine makes a run long, not hang

MODES = {"count": 1, "kill": 2, "torn": 3, "full": 4}


def main():
    shim = ctypes.CDLL(sys.argv[1])
    shim.harness_arm.argtypes = [ctypes.c_char_p, ctypes.c_int, ctypes.c_long]
    shim.harness_points.restype = ctypes.c_long
    _import_all()
    answers = os.fdopen(os.dup(1), "w")
    for line in sys.stdin:
        request = json.loads(line)
        children = [_forked(shim, request["root"], job) for job in request["jobs"]]
        codes = [_waited(child, request["limit"]) for child in children]
        answers.write(json.dumps(codes) + "\n")
        answers.flush()


def _import_all():
    import elevon
    import studies

    for package in (elevon, studies):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)


def _forked(shim, root, job):
    child = os.fork()
    if child:
        return child
    code = 70
    try:
        out = Path(job["out"])
        for name, number in (("stdout", 1), ("stderr", 2)):
            os.dup2(os.open(out / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        os.chdir(root)
        code = _run(shim, root, job, out)
    except BaseException:  # noqa: BLE001 - a child must end here, whatever happens
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _run(shim, root, job, out):
    import elevon.cli
    import studies

    words = job["argv"]
    study = words[0] == "studies"
    main, words = (studies.main, words[1:]) if study else (elevon.cli.main, words)
    sys.argv = ["elevon", *words]
    shim.harness_arm(root.encode(), MODES[job["mode"]], job["at"])
    try:
        return main(words)
    finally:
        kinds = ctypes.create_string_buffer(1 << 16)
        count = shim.harness_points(kinds)
        shim.harness_arm(b"/", 0, 0)
        (out / "points").write_bytes(kinds.raw[: min(count, 1 << 16)])


def _waited(child, limit):
    """Wait for a child that may take `limit` of processor time, and ten times as long."""
    end = time.monotonic() + _CLOCK * limit
    while time.monotonic() < end and _worked(child) < limit:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def _worked(child):
    """Seconds of processor time of a process."""
    fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
