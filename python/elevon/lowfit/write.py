"""The fitted numbers as entries of a parameter set."""

from __future__ import annotations

import os
from pathlib import Path

from elevon.lowfit.fit import LowFit
from elevon.parameters import Parameter
from elevon.parameters.find import base_reference
from elevon.parameters.write import write_set


def fitted_parameters(fit: LowFit) -> list[Parameter]:
    """Return one entry for each fitted number: source, old value, deviation over the cases."""
    names = "; ".join(case.name for case in fit.cases)
    entries = []
    for path, old, new, spread in fit.fitted:
        note = f"For drive.kind = {fit.drive}. Standard deviation over the cases {spread:.2g}."
        source = f"fitted to the switching model over {len(fit.cases)} cases: {names}"
        rounded = float(f"{new:.4g}")
        entries.append(Parameter(path, rounded, "", source, note, "calibrated", old))
    return entries


def write_fit(path: str | os.PathLike[str], fit: LowFit, *, force: bool = False) -> Path:
    """Write the fitted numbers as an actuator file; errors as `elevon.files.write_text`."""
    target = Path(path).expanduser()
    return write_set(
        target,
        name=_name(target.stem),
        changes=fitted_parameters(fit),
        base=base_reference(fit.before.path, fit.before.name, target),
        title=f"{fit.before.title or fit.before.name}, reduced-order model fitted",
        force=force,
    )


def _name(stem: str) -> str:
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in stem)
    return plain if plain and plain[0].isalnum() else f"actuator-{plain.strip('-._')}"
