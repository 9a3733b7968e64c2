"""The prebuilt binary of this installation, and what FMI calls the platform it is for."""

from __future__ import annotations

import platform
import sys
from pathlib import Path

from elevon.errors import InputError, unknown

#: Where the build puts the binary.
FOLDER = Path(__file__).parent / "lib"
_MACHINES = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}
_SYSTEMS = {"linux": ("linux", "so"), "darwin": ("darwin", "dylib"), "win32": ("windows", "dll")}
#: FMI 2.0 has names for these alone.
_SHORT = {"x86_64-linux": "linux64", "x86_64-darwin": "darwin64", "x86_64-windows": "win64"}
VERSIONS = ("2.0", "3.0")


def check_version(version: str) -> str:
    """Return a version of FMI, or raise `UnknownNameError` with those that are written."""
    if version not in VERSIONS:
        raise unknown("version of FMI", version, VERSIONS, "--version")
    return version


def this_platform() -> str:
    """Return this machine's platform as FMI 3.0 names it, such as ``x86_64-linux``.

    Raises
    ------
    InputError
        FMI has no name for it.
    """
    machine = _MACHINES.get(platform.machine().lower())
    system = _SYSTEMS.get(sys.platform)
    if machine is None or system is None:
        raise InputError(f"no binary of FMUs for {platform.machine()} and {sys.platform}")
    return f"{machine}-{system[0]}"


def binary_place(version: str, wanted: str | None = None) -> str:
    """Return the place of the binary in an FMU of a version.

    Raises
    ------
    InputError
        Another platform than this installation's, or one that FMI 2.0 has no name for.
    """
    here = this_platform()
    if wanted not in (None, here):
        raise InputError(
            f"--platform {wanted}: this installation has the binary of {here} alone; export where "
            "Elevon is installed for the other one"
        )
    if version == "3.0":
        return f"binaries/{here}/elevon.{_ending()}"
    if here not in _SHORT:
        raise InputError(f"--version 2.0: FMI 2.0 has no name for {here}; use --version 3.0")
    return f"binaries/{_SHORT[here]}/elevon.{_ending()}"


def library() -> Path:
    """Return the path of the prebuilt binary.

    Raises
    ------
    InputError
        It is not part of this installation.
    """
    path = FOLDER / f"elevon.{_ending()}"
    if not path.is_file():
        raise InputError(
            f"{path}: the binary of FMUs is not there; build it with `make setup`, or install a "
            "wheel"
        )
    return path


def _ending() -> str:
    return _SYSTEMS[sys.platform][1]
