"""``elevon design``: experiments and parts."""

from __future__ import annotations

from typing import Any

from elevon.cli.groups import group
from elevon.cli.output import answer, print_table
from elevon.cli.shell import Answer, command
from elevon.units import parse_quantity

app = group("Design experiments and parts.")


@command(app)
def spring(
    *,
    wire: str = "3 mm",
    coil: str = "34 mm",
    torque: str = "12 N m",
    guide: str = "160 mm",
    force: str = "80 N",
    extension: str = "1.3 m",
    modulus: str = "81500 N/mm2",
    strength: str = "1730 N/mm2",
    safety: str = "2",
    longest: str = "1.1 m",
    mover: str = "10 mm",
) -> Answer:
    """Size the load module's springs: stress check, stiffness, other designs that do as well."""
    from elevon.bench.spring import SpringTask, design_spring, search_springs

    task = SpringTask(
        torque=parse_quantity(torque, "N m", "--torque"),
        guide_diameter=parse_quantity(guide, "m", "--guide"),
        force=parse_quantity(force, "N", "--force"),
        extension=parse_quantity(extension, "m", "--extension"),
        shear_modulus=parse_quantity(modulus, "N/m2", "--modulus"),
        strength=parse_quantity(strength, "N/m2", "--strength"),
        safety=parse_quantity(safety, "1", "--safety"),
    )
    chosen = design_spring(
        task,
        wire=parse_quantity(wire, "m", "--wire"),
        coil=parse_quantity(coil, "m", "--coil"),
    )
    others = search_springs(task, longest=parse_quantity(longest, "m", "--longest"))
    dx = parse_quantity(mover, "m", "--mover")
    result = {
        "status": "pass" if chosen.feasible else "fail",
        "checks": _checks(chosen),
        "design": {**_row(chosen), "radial_force_N": chosen.radial_force(dx)},
        "feasible": [_row(design) for design in others],
    }
    code = 0 if chosen.feasible else 1
    return Answer(result, lambda: _show(chosen, others, dx), code)


def _checks(design: Any) -> list[dict[str, Any]]:
    from elevon.bench.spring import INDEX_RANGE

    task = design.task
    low, high = INDEX_RANGE
    values = (
        ("shear stress", design.stress / 1e6, task.allowed_stress / 1e6, "N/mm2",
         design.stress <= task.allowed_stress),
        ("coil diameter", 1e3 * design.coil, 1e3 * task.largest_coil(design.wire), "mm",
         design.coil <= task.largest_coil(design.wire)),
        ("least spring index", design.index, low, "1", design.index >= low),
        ("greatest spring index", design.index, high, "1", design.index <= high),
    )  # fmt: skip
    return [
        {"name": name, "value": value, "limit": limit, "unit": unit, "passed": passed}
        for name, value, limit, unit, passed in values
    ]


def _row(design: Any) -> dict[str, Any]:
    return {
        "wire_mm": 1e3 * design.wire,
        "coil_mm": 1e3 * design.coil,
        "largest_coil_mm": 1e3 * design.task.largest_coil(design.wire),
        "coils": design.coils,
        "free_length_mm": 1e3 * design.free_length,
        "stiffness_N_per_mm": 1e-3 * design.stiffness,
        "stress_N_per_mm2": 1e-6 * design.stress,
        "curved_stress_N_per_mm2": 1e-6 * design.curved_stress,
        "allowed_stress_N_per_mm2": 1e-6 * design.task.allowed_stress,
        "safety": design.safety,
        "cable_force_N": design.task.cable_force,
        "torsional_stiffness_Nm_per_rad": design.torsional_stiffness,
        "rotation_rad": design.rotation,
        "wire_volume_cm3": 1e6 * design.wire_volume,
        "feasible": design.feasible,
    }


def _show(chosen: Any, others: list[Any], dx: float) -> None:
    verdict = "holds" if chosen.feasible else "does not hold"
    answer(f"The spring {verdict}: safety {chosen.safety:.3g}; {len(others)} other designs do")
    rows = [(name.replace("_", " "), _text(value)) for name, value in _row(chosen).items()]
    rows.append((f"radial force at {1e3 * dx:g} mm, N", _text(chosen.radial_force(dx))))
    print_table(("quantity", "value"), rows, title="Spring of the load module")
    least: dict[float, Any] = {}
    for design in others:
        least.setdefault(design.wire, design)
    cells = [
        (f"{1e3 * d.wire:g}", f"{1e3 * d.coil:g}", d.coils, f"{1e3 * d.free_length:.0f}",
         f"{1e-6 * d.stress:.0f}", f"{d.safety:.2f}", f"{1e6 * d.wire_volume:.0f}")
        for d in least.values()
    ]  # fmt: skip
    heads = ("wire mm", "coil mm", "coils", "length mm", "stress N/mm2", "safety", "wire cm3")
    print_table(heads, cells, title=f"Least wire for each diameter ({len(others)} designs hold)")


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
