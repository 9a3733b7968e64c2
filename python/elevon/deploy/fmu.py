"""FMUs: one zip file with a description, the resolved actuator, and the prebuilt binary."""

from __future__ import annotations

import io
import os
import platform
import sys
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import elevon
from elevon.actuator import Actuator
from elevon.deploy.description import (
    FmuVariable,
    Model,
    description,
    fmu_variables,
    rows,
    terminals,
)
from elevon.deploy.document import RunDocument, as_text, run_document, token_of
from elevon.errors import InputError, unknown
from elevon.files import check_output, write_bytes
from elevon.option import Option, Quantity
from elevon.units import parse_quantity

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


#: Files of a zip carry a time; a fixed one keeps exports of the same model equal to the byte.
_TIME = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class FmuFile:
    """An FMU that was written.

    Attributes
    ----------
    path : Path
        Where it lies.
    version : str
        ``2.0`` or ``3.0``.
    document : RunDocument
        What it runs.
    variables : tuple of FmuVariable
        In the order of their value references.
    bytes : int
        Size of the file.
    """

    path: Path
    version: str
    document: RunDocument
    variables: tuple[FmuVariable, ...]
    bytes: int

    def count(self, role: str) -> int:
        """Return how many variables have a role (``input``, ``output``, ``parameter``)."""
        return sum(variable.role == role for variable in self.variables)


def export_fmu(
    actuator: Actuator | str,
    path: Annotated[str | os.PathLike[str], Option(("--out", "-o"))],
    *,
    fidelity: str = "high",
    version: str = "3.0",
    mode: str | None = None,
    signals: Annotated[str | Sequence[str], Option(metavar="NAMES", complete="signals")] = (),
    step: Quantity = "1 ms",
    platform: str | None = None,
    force: bool = False,
) -> FmuFile:
    """Write an actuator as an FMU for co-simulation (docs/how-to/deploy.md).

    Parameters
    ----------
    actuator : Actuator or str
        A loaded one, a name or a path.
    path : path
        The file to write, ending in ``.fmu``.
    fidelity : str
        ``high`` or ``low``.
    version : str
        Of FMI: ``2.0`` or ``3.0``.
    mode : str, optional
        What the command demands; by default position, or a gear's commands.
    signals : str or sequence of str
        Outputs beyond the drive log's: names or groups, by commas or repeated.
    step : float or str
        The suggested communication step, s or with a unit: a whole number of solver steps. An
        importer may use any other such step.
    platform : str, optional
        Name as in FMI 3.0, such as ``x86_64-linux``; default: this installation's.
    force : bool
        Replace an existing file.

    Returns
    -------
    FmuFile
        What was written.

    Raises
    ------
    InputError
        No such actuator, fidelity, version, mode, signal or platform; a step that is no whole
        number of solver steps; values that cannot be together.
    OutputError
        The file cannot be written.
    """
    check_version(version)
    if Path(path).suffix != ".fmu":
        raise InputError(f"{os.fspath(path)}: an FMU's name ends in .fmu")
    place = binary_place(version, platform)
    document = run_document(actuator, fidelity=fidelity, mode=mode, signals=signals)
    period = _period(step, document.step)
    check_output(path, force=force)
    variables = fmu_variables(document)
    parts = _parts(document, variables, version, period)
    parts[place] = library().read_bytes()
    data = _zipped(parts)
    written = write_bytes(path, data, force=force)
    return FmuFile(written, version, document, tuple(variables), len(data))


def _period(given: float | str, step: float) -> float:
    seconds = parse_quantity(given, "s", "--step")
    count = round(seconds / step) if seconds > 0.0 else 0
    if count < 1 or abs(seconds - count * step) > 1e-6 * step * count:
        below = max(count, 1) * step
        raise InputError(
            f"--step = {given}: no whole number of solver steps of {step:g} s; nearest: "
            f"{below:.9g} s"
        )
    return seconds


def _parts(
    document: RunDocument, variables: list[FmuVariable], version: str, period: float
) -> dict[str, bytes]:
    """Return the files of the FMU but its binary."""
    contents = {**document.contents(), "variables": rows(variables)}
    token = token_of(contents)
    name = document.actuator.name
    model = Model(
        name=name,
        text=f"{name}, {document.fidelity} fidelity, command: {document.mode}",
        token=token,
        generator=f"Elevon {elevon.__version__}",
        step=document.step,
        period=period,
    )
    parts = {
        "modelDescription.xml": description(model, variables, version),
        "resources/elevon.json": as_text({**contents, "token": token}).encode(),
    }
    extra = terminals(variables) if version == "3.0" else None
    if extra is not None:
        parts["terminalsAndIcons/terminalsAndIcons.xml"] = extra
    return parts


def _zipped(parts: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in parts.items():
            entry = zipfile.ZipInfo(name, _TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            file.writestr(entry, data)
    return buffer.getvalue()
