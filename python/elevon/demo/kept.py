"""What an interrupted demonstration leaves for the next one: its finished steps, as JSON.

A folder ``unfinished`` beside the reports names the work; each finished step adds a file with its
result, written whole. The work is told by the package's own files, the seed and both parameter
sets, a step also by what it was made from. What does not fit to the digit is made again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from elevon.bench.state import digests
from elevon.errors import OutputExistsError
from elevon.files import write_text

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["STEPS", "Kept", "finished_steps", "inputs_of", "work_key"]

Result = TypeVar("Result")
FOLDER = "unfinished"
_WORK = "work.json"
_CODE = {".py", ".so", ".pyd", ".toml", ".csv", ".j2", ".css", ".js"}

#: Steps that are kept, by the name of their file, and what they are called.
STEPS = {
    "backlash": "the backlash table",
    "calibration": "the calibration",
    "before": "the validation of the published values",
    "after": "the validation of the calibrated values",
}


def work_key(seed: int, base: Actuator, hidden: Actuator) -> str:
    """Return digits that tell this work, done by this very package, from any other."""
    import elevon

    root = Path(str(elevon.__file__)).parent
    digest = hashlib.sha256()
    for path in sorted(path for path in root.rglob("*") if path.suffix in _CODE):
        digest.update(f"{path.relative_to(root).as_posix()}\n".encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    digest.update(json.dumps([elevon.__version__, seed, base.hash, hidden.hash]).encode())
    return digest.hexdigest()[:32]


class Kept:
    """The finished steps of one work.

    Parameters
    ----------
    out : Path
        Folder of the demonstration.
    key : str
        From `work_key`.
    """

    def __init__(self, out: Path, key: str) -> None:
        self.out = out
        self.folder = out / FOLDER
        self.key = key

    def begun(self, *, force: bool) -> bool:
        """Whether this very work was begun here and not finished.

        Raises
        ------
        OutputExistsError
            Without `force`: other work was.
        """
        found = _key(self.folder)
        if found == self.key:
            return True
        if found is not None and not force:
            raise OutputExistsError(
                f"{self.folder}: holds an unfinished demonstration of other work; use force "
                "(--force) to replace it"
            )
        return False

    def begin(self) -> None:
        """Forget whatever was kept and name the work."""
        self.clear()
        write_text(self.folder / _WORK, json.dumps({"work": self.key}) + "\n", force=True)

    def load(
        self, name: str, inputs: str, read: Callable[[Any], Result]
    ) -> tuple[Result, float] | None:
        """Return the result of a finished step and the seconds it took, or None.

        Parameters
        ----------
        name : str
            Of `STEPS`.
        inputs : str
            What the step is made from, in digits.
        read : callable
            Turns the JSON form into the result; a `KeyError`, `TypeError` or `ValueError` of it
            means that the file is damaged.
        """
        data = _read(self.folder / f"{name}.json")
        if (data.get("work"), data.get("inputs")) != (self.key, inputs):
            return None
        files = data.get("files")
        if not isinstance(files, Mapping) or digests(self.out / n for n in files) != files:
            return None
        try:
            return read(data["result"]), float(data["seconds"])
        except (KeyError, TypeError, ValueError):
            return None

    def save(
        self, name: str, inputs: str, result: Any, seconds: float, files: Sequence[Path]
    ) -> None:
        """Keep the JSON form of a step's result; it counts while `files` are as they are now."""
        content = {
            "work": self.key,
            "inputs": inputs,
            "seconds": seconds,
            "files": digests(files),
            "result": result,
        }
        write_text(self.folder / f"{name}.json", json.dumps(content) + "\n", force=True)

    def clear(self) -> None:
        """Remove what is kept: the work is done, or another one begins."""
        for path in (self.folder / _WORK, *(self.folder / f"{name}.json" for name in STEPS)):
            path.unlink(missing_ok=True)
        with suppress(OSError):  # not there, or something of another's is in it
            self.folder.rmdir()


def finished_steps(out: Path) -> list[str]:
    """Name the steps, and the logs, that an unfinished demonstration in a folder has finished."""
    from elevon.bench.run import state_file
    from elevon.bench.state import finished_logs
    from elevon.demo.procedure import demo_procedure

    folder = out / FOLDER
    key = _key(folder)
    if key is None:
        return []
    found = [text for n, text in STEPS.items() if _read(folder / f"{n}.json").get("work") == key]
    procedure = demo_procedure()
    logs = len(finished_logs(state_file(out / "logs", procedure.name)))
    return [*found, *([f"{logs} of {len(procedure.traces)} logs"] if logs else [])]


def inputs_of(files: Iterable[Path], *more: str) -> str:
    """Return digits over files and texts that a step is made from."""
    content = json.dumps([sorted(digests(files).items()), *more])
    return hashlib.sha256(content.encode()).hexdigest()[:32]


def _key(folder: Path) -> str | None:
    key = _read(folder / _WORK).get("work")
    return key if isinstance(key, str) else None


def _read(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
