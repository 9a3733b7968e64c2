"""FMUs: one zip file with a description, the resolved actuator, and the prebuilt binary."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import elevon
from elevon.actuator import Actuator
from elevon.deploy.binary import binary_place, check_version, library
from elevon.deploy.description import Model, description, terminals
from elevon.deploy.document import RunDocument, as_text, run_document, token_of
from elevon.deploy.variables import FmuVariable, fmu_variables, rows
from elevon.errors import InputError
from elevon.files import check_output, write_bytes
from elevon.units import parse_quantity

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
    path: str | os.PathLike[str],
    *,
    fidelity: str = "high",
    version: str = "3.0",
    mode: str | None = None,
    signals: str | Sequence[str] = (),
    step: float | str = "1 ms",
    platform: str | None = None,
    force: bool = False,
) -> FmuFile:
    """Write an actuator as an FMU for co-simulation (docs/how-to/deploy.md).

    Parameters
    ----------
    actuator : Actuator or str
        A loaded one, a name or a path.
    path : path
        The file, ending in ``.fmu``.
    fidelity : str
        ``high`` or ``low``.
    version : str
        Of FMI, ``2.0`` or ``3.0``.
    mode : str, optional
        What the command demands; by default position, or a gear's commands.
    signals : str or sequence of str
        Outputs beyond the drive log's: names or groups, as for `record`.
    step : float or str
        The suggested communication step, s or with a unit: a whole number of solver steps. An
        importer may use any other such step.
    platform : str, optional
        As FMI 3.0 names it; this installation's.
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
