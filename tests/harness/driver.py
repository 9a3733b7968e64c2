"""Runs a command again and again over the same folder, each time with another fault put in."""

import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections import Counter
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

from elevon.worklog import LOCK
from tests.harness.readable import readable
from tests.harness.recipes import Recipe

LIMIT = 240.0
"""Seconds of processor time after which a run counts as hung; ten times as long by the clock."""

#: What is no result: hidden files (temporary ones, locks, staged ones).
_HIDDEN = re.compile(r"(^|/)\.[^/]")
#: The random part of a temporary file's name.
_RANDOM = re.compile(r"(?<=\.)[0-9a-f]{12}(?=\.part)")
FOREIGN = "must stay as it is\n"


@dataclass
class Counts:
    """What was tried and what came of it.

    Attributes
    ----------
    points : int
        System calls of the command that change a file below its folder.
    tried : Counter
        Runs of each mode: ``kill``, ``torn``, ``full``, ``two``.
    kinds : Counter
        Runs after which the folder was the ``old`` one, the ``new`` one or one ``between``.
    repaired : int
        Runs after which the command named for it made the folder that of a whole run.
    foreign : int
        Runs after which a file that is none of the command's had changed.
    faults : list of str
        What must not be.
    """

    points: int = 0
    tried: Counter = field(default_factory=Counter)
    kinds: Counter = field(default_factory=Counter)
    repaired: int = 0
    foreign: int = 0
    faults: list = field(default_factory=list)

    @property
    def row(self):
        """The line of a table below `HEAD`."""
        tried = [self.tried[mode] for mode in ("kill", "torn", "full", "two")]
        kinds = [self.kinds[kind] for kind in ("old", "new", "between")]
        return [self.points, *tried, *kinds, self.repaired, self.foreign, len(self.faults)]


HEAD = ("points", "kills", "torn", "full", "two", "old", "new", "between", "repaired", "foreign",
        "faults")  # fmt: skip


def table(rows):
    """Return a table of counts: one command a line, and their sum."""
    rows = {**rows, "all": [sum(column) for column in zip(*rows.values(), strict=True)]}
    width = max(len(name) for name in rows)
    lines = [" " * width + "".join(f"{name:>9}" for name in HEAD)]
    lines += [name.ljust(width) + "".join(f"{n:9d}" for n in row) for name, row in rows.items()]
    return "\n".join(lines)


class Driver:
    """The forking process, and one recipe at a time in a folder of its own."""

    def __init__(self, folder):
        self.folder = folder.resolve()
        source = Path(__file__).parent
        shim = self.folder / "shim.so"
        command = ["cc", "-shared", "-fPIC", "-O1", "-o", shim, source / "shim.c", "-ldl"]
        subprocess.run(command, check=True)
        self.process = subprocess.Popen(
            [sys.executable, source / "zygote.py", shim],
            env=_environment(shim), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.root = self.folder / "work"
        self.outside = self.folder / "outside"
        self.outside.mkdir()
        (self.outside / "foreign.txt").write_text(FOREIGN)

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()

    def run(self, *commands, mode="count", at=0):
        """Run commands at once; return exit code, standard error and points of each."""
        outs = [self.folder / f"out{k}" for k in range(len(commands))]
        for out in outs:
            shutil.rmtree(out, ignore_errors=True)
            out.mkdir()
        jobs = [{"argv": list(argv), "out": str(out), "mode": mode, "at": at}
                for argv, out in zip(commands, outs, strict=True)]  # fmt: skip
        request = {"root": str(self.root), "jobs": jobs, "limit": LIMIT}
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        codes = json.loads(self.process.stdout.readline())
        return [(code, (out / "stderr").read_text("utf-8", "replace"), _points(out))
                for code, out in zip(codes, outs, strict=True)]  # fmt: skip

    def prepare(self, recipe: Recipe):
        """Make what is there before the command, and keep a copy of it."""
        shutil.rmtree(self.root, ignore_errors=True)
        self.root.mkdir()
        for name, text in (recipe.files or {}).items():
            _put(self.root, name, text)
        for command in recipe.before:
            if command[0] == "-":
                for path in self.root.glob(command[1]):
                    path.unlink()
                continue
            ((code, error, _),) = self.run(command)
            assert code in {0, 1}, (command, code, error)
        for folder in (self.root, *[path for path in self.root.iterdir() if path.is_dir()]):
            (folder / "foreign.txt").write_text(FOREIGN)
        shutil.rmtree(self.folder / "before", ignore_errors=True)
        shutil.copytree(self.root, self.folder / "before")

    def restore(self):
        """Put the folder back as it was before."""
        shutil.rmtree(self.root)
        shutil.copytree(self.folder / "before", self.root)

    def state(self):
        """Return the hash of every visible file."""
        return {name: mark for name, mark in self.everything() if not _HIDDEN.search(name)}

    def everything(self):
        """Return name and hash of every file but locks, which hold a process number."""
        return frozenset(
            (path.relative_to(self.root).as_posix(), hashlib.sha256(path.read_bytes()).hexdigest())
            for path in self.root.rglob("*")
            if path.is_file() and path.name != LOCK
        )


class Trial:
    """All faults of one command."""

    def __init__(self, driver, name, recipe):
        self.driver, self.recipe, self.counts = driver, recipe, Counts()
        self.mended = {}
        self.command = (*name.split(), *recipe.words)
        self.repair = recipe.repair or self.command
        driver.prepare(recipe)
        self.before = driver.state()
        ((self.code, error, self.points),) = driver.run(self.command)
        assert self.code in recipe.code, (self.command, self.code, error)
        self.after = driver.state()
        self.counts.points = len(self.points)
        driver.restore()
        driver.run(self.command)
        again = driver.state()
        #: Files that are another at each run (they hold times): whole is all that can be asked.
        self.changing = {name for name in self.after if again.get(name) != self.after[name]}

    def at_points(self, mode, kinds, most):
        """Put a fault in at each point of some kinds, or at `most` of them, evenly spread."""
        places = [k for k, kind in enumerate(self.points, 1) if kind in kinds]
        if len(places) > most:
            places = [places[round(i * (len(places) - 1) / (most - 1))] for i in range(most)]
        for at in places:
            self.driver.restore()
            ((code, error, _),) = self.driver.run(self.command, mode=mode, at=at)
            self._judge(mode, f"{self.points[at - 1]}{at}", [code], error)

    def at_once(self):
        """Run the command twice at the same time."""
        self.driver.restore()
        ran = self.driver.run(self.command, self.command)
        errors = "\n".join(error for _, error, _ in ran)
        self._judge("two", "once", [code for code, _, _ in ran], errors)

    def _judge(self, mode, place, codes, error):
        self.counts.tried[mode] += 1
        killed = mode in {"kill", "torn"}
        wrong = self._wrong(codes, error, killed)
        state = self.driver.state()
        kind = self._kind(state)
        self.counts.kinds[kind] += 1
        if kind != "new" and not killed and any(code in self.recipe.code for code in codes):
            wrong.append(f"exit {codes}, yet the folder is {kind}: {self._difference(state)}")
        wrong += self._torn(state) + self._foreign()
        if not wrong and not self.recipe.reads:
            wrong += self._mended_once()
        if wrong:
            words = " ".join(self.command)
            self.counts.faults.append(f"{words}: {mode} at {place}: {'; '.join(wrong)}")

    def _wrong(self, codes, error, killed):
        wrong = ["Traceback: " + error.strip().splitlines()[-1]] if "Traceback" in error else []
        if None in codes:
            wrong.append("hangs")
        if killed and any(code >= 0 for code in codes if code is not None):
            wrong.append(f"was not killed: exit {codes}")
        if not killed and any(code is not None and code not in {0, 1, 2, 130} for code in codes):
            wrong.append(f"exit {codes}: {error[-200:]}")
        return wrong

    def _kind(self, state):
        if state == self.before:
            return "new" if self.before == self.after else "old"
        return "new" if self._same(state, self.after) else "between"

    def _same(self, state, wanted):
        return state.keys() == wanted.keys() and all(
            name in self.changing or state[name] == wanted[name] for name in wanted
        )

    def _difference(self, state, wanted=None):
        wanted = self.after if wanted is None else wanted
        names = state.keys() | wanted.keys()
        other = (n for n in names if state.get(n) != wanted.get(n) and n not in self.changing)
        return sorted(other)[:6]

    def _torn(self, state):
        """Files that are neither the old nor the new ones, nor whole ones on the way there."""
        torn = [
            name for name, hash_ in state.items()
            if hash_ not in {self.before.get(name), self.after.get(name)}
            and not readable(self.driver.root / name)
        ]  # fmt: skip
        gone = [name for name in self.before if name not in state and name in self.after]
        return [f"{text}: {names}" for text, names in {"torn": torn, "gone": gone}.items() if names]

    def _foreign(self):
        """Files that are none of the command's, and are not as they were."""
        kept = (path.relative_to(self.driver.folder / "before")
                for path in (self.driver.folder / "before").rglob("foreign.txt"))  # fmt: skip
        places = [self.driver.outside / "foreign.txt", *(self.driver.root / path for path in kept)]
        changed = [str(p) for p in places if not p.is_file() or p.read_text() != FOREIGN]
        self.counts.foreign += bool(changed)
        return [f"foreign files changed: {changed}"] if changed else []

    def _mended_once(self):
        """Repair; a folder that is to the byte one that was repaired before is not tried again."""
        whole = frozenset((_RANDOM.sub("x", name), mark) for name, mark in self.driver.everything())
        if whole not in self.mended:
            self.mended[whole] = self._unrepaired()
        self.counts.repaired += not self.mended[whole]
        return self.mended[whole]

    def _unrepaired(self):
        ((code, error, _),) = self.driver.run(self.repair)
        state = self.driver.state()
        if code is None or code not in {*self.recipe.code, 0} or "Traceback" in error:
            return [f"the repair ends with {code}: {error[-300:]}"]
        if self.repair != self.command and not self._same(state, self.after):
            if state != self.before:  # repaired to the old one, or to the new one
                ((code, error, _),) = self.driver.run(self.command)
                state = self.driver.state()
            else:
                state = self.after
        if not self._same(state, self.after):
            return [f"not repaired: {self._difference(state)} {error[-200:]}"]
        return []


def _environment(shim):
    import os

    return {**os.environ, "LD_PRELOAD": str(shim), "OPENBLAS_NUM_THREADS": "1",
            "MPLBACKEND": "Agg", "NO_COLOR": "1"}  # fmt: skip


def _points(out):
    path = out / "points"
    return path.read_bytes().decode("ascii") if path.is_file() else ""


def _put(root, name, text):
    if text == "@torino_compliance":
        text = (files("elevon.data") / "torino_compliance.csv").read_text("utf-8")
    elif text == "@history":
        import tomlkit

        from tests.prognose.test_predict import FLIGHT, folder

        folder(root / name, serial=[name] * 4)
        (root / "mission.toml").write_text(tomlkit.dumps(FLIGHT))
        return
    elif text == "@inspections":
        _put_inspections(root / name)
        return
    (root / name).write_text(text)


def _put_inspections(folder):
    """Note inspections of two units as finished, but one; each row says what was true."""
    from elevon.worklog import finished
    from studies.inspection_error.campaign import Inspected
    from studies.inspection_error.plan import visits

    with finished(folder, "inspection-error seed 0") as log:
        of_level = {}
        for unit, visit in [(k, visit) for k in range(2) for visit in visits(0, k)]:
            row = Inspected(visit.name, unit, visit.law, visit.level, visit.severity, 1, 1.0,
                            1.01 * visit.severity, 0.1 * visit.severity, 0.1 * visit.severity,
                            0.01, ())  # fmt: skip
            of_level.setdefault((unit, visit.law, visit.level), []).append(row.to_dict())
        del of_level[1, "gear_wear", -1]  # one day: the cheapest
        for rows in of_level.values():
            log.note(rows[0]["name"], [], rows=rows)
