"""Where actuator files are found: shipped with the package, in your folders, or by path."""

from __future__ import annotations

import os
from pathlib import Path

from elevon.errors import InputError, UnknownNameError, unknown
from elevon.files import visible

#: Folders with more actuator files, separated like PATH.
VARIABLE = "ELEVON_ACTUATORS"

_SHIPPED = Path(__file__).parent.parent / "actuators"
_NEUTRAL = Path(__file__).parent / "neutral"


def set_paths() -> dict[str, Path]:
    """Return every actuator file by name; yours hides a shipped one of the same name."""
    folders = [_SHIPPED, *_user_folders()]
    return {file.stem: file for folder in folders for file in visible(folder, "*.toml")}


def set_names() -> list[str]:
    """Return the names of the actuators that can be loaded by name, sorted."""
    return sorted(set_paths())


def is_shipped(path: Path) -> bool:
    """Return whether a file is one that the package ships."""
    return path.resolve().parent in (_SHIPPED.resolve(), _NEUTRAL.resolve())


def is_neutral(path: Path) -> bool:
    """Return whether a file is a neutral base: complete only with the rules of a design."""
    return path.resolve().parent == _NEUTRAL.resolve()


def neutral_names() -> list[str]:
    """Return the names that a file with a design may have as its base."""
    return sorted(path.stem for path in visible(_NEUTRAL, "*.toml"))


def find_set(reference: str | os.PathLike[str], folder: Path | None = None) -> Path:
    """Find an actuator file by name or by path.

    Parameters
    ----------
    reference : str or path
        The name of an actuator, or a TOML file.
    folder : Path, optional
        Where a relative file is looked for first: the folder of the file that names it as `base`.
        There, or where the program runs, ``mine`` is ``mine.toml`` too.

    Raises
    ------
    UnknownNameError
        No actuator of that name; the message holds the nearest, and the file to write.
    InputError
        The file does not exist.
    """
    text = os.fspath(reference)
    if text.endswith(".toml") or os.sep in text:
        return _file(text, folder)
    known = set_paths()
    if text in known:
        return known[text]
    if text in neutral_names():
        return _NEUTRAL / f"{text}.toml"
    near = [place / f"{text}.toml" for place in (folder or Path(), Path())]
    path = next((place for place in near if _is_file(place)), None)
    if path is None:
        error = unknown("actuator", text, known)
        where = near[0]
        raise UnknownNameError(f"{error}; or write {where}", error.name, error.nearest)
    return path


def _file(text: str, folder: Path | None) -> Path:
    path = Path(text).expanduser()
    if folder is not None and not path.is_absolute() and _is_file(folder / path):
        path = folder / path
    if not _is_file(path):
        raise InputError(f"{path}: no such actuator file")
    return path


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # longer than a name may be
        return False


def _user_folders() -> list[Path]:
    folders = [
        Path(part).expanduser() for part in os.environ.get(VARIABLE, "").split(os.pathsep) if part
    ]
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"{VARIABLE}: {folder} is not a folder")
    return folders


def base_reference(path: Path | None, name: str, target: Path) -> str:
    """Return how a new file names its base: a shipped set's name, else the path to it."""
    if path is None:
        return name
    try:
        if find_set(name).resolve() == path.resolve():
            return name
    except ValueError:
        pass
    return os.path.relpath(path.resolve(), target.resolve().parent).replace(os.sep, "/")
