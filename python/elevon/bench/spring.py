"""Sizing of the load module's traction springs, with the stress check of the bench's designers.

Transmission thesis (2024), chapter 4: two cables wind on a guide of 160 mm, each pulls a spring.
Wire under torsion and shear, von Mises: tau_max = 8 F D / (pi d^3) + 4 F / (pi d^2), at most
sigma / (sqrt 3 c); stiffness K = G d^4 / (8 n D^3); coils touch, so the free length is n d.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from elevon.data import packaged_toml
from elevon.errors import InputError, RangeError
from elevon.option import Quantity
from elevon.units import parse_quantity

#: Preferred wire diameters [m].
STANDARD_WIRES: tuple[float, ...] = tuple(
    round(1e-3 * d, 6) for d in packaged_toml("elevon.bench", "wires.toml")["diameters_mm"]
)
_COIL_STEP = 1e-3  # m, of the coil diameters tried
INDEX_RANGE = (4.0, 20.0)  # D / d that can be wound cold (EN 13906-2)


@dataclass(frozen=True, slots=True)
class SpringTask:
    """What the springs must do. SI; the defaults are the bench's.

    Attributes
    ----------
    torque : float
        Greatest torque on the gearbox [N m].
    guide_diameter : float
        Diameter of the winding guide [m].
    force : float
        Force each spring is designed for [N]: torque / guide diameter (75 N), rounded up to 80.
    extension : float
        Extension at that force [m].
    shear_modulus : float
        Of the wire [Pa].
    strength : float
        Of the wire [Pa]: EN 10270-1 SM/SH/DH, as the designers took it for 3 mm.
    safety : float
        Safety factor on it.
    """

    torque: float = 12.0
    guide_diameter: float = 0.160
    force: float = 80.0
    extension: float = 1.3
    shear_modulus: float = 81.5e9
    strength: float = 1730e6
    safety: float = 2.0

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise RangeError(f"spring: {name} = {value!r} must be above 0")
        if self.force < self.cable_force:
            raise InputError(
                f"spring: force = {self.force:g} N is less than the {self.cable_force:g} N that "
                f"{self.torque:g} N m on a guide of {1e3 * self.guide_diameter:g} mm need"
            )

    @property
    def cable_force(self) -> float:
        """Force in each of the two cables at the greatest torque [N]: torque / diameter."""
        return self.torque / self.guide_diameter

    @property
    def stiffness(self) -> float:
        """Stiffness wanted [N/m]."""
        return self.force / self.extension

    @property
    def allowed_stress(self) -> float:
        """Greatest shear stress [Pa]: strength / (sqrt 3 safety)."""
        return self.strength / (math.sqrt(3.0) * self.safety)

    def largest_coil(self, wire: float) -> float:
        """Greatest mean coil diameter [m] the stress allows for a wire [m]."""
        return self.allowed_stress * math.pi * wire**3 / (8.0 * self.force) - 0.5 * wire


@dataclass(frozen=True, slots=True)
class SpringDesign:
    """A spring and what it does on the bench.

    Attributes
    ----------
    task : SpringTask
        What it was designed for.
    wire, coil : float
        Wire diameter and mean coil diameter [m].
    coils : int
        Number of coils.
    """

    task: SpringTask
    wire: float
    coil: float
    coils: int

    @property
    def stiffness(self) -> float:
        """Stiffness of one spring [N/m]."""
        return self.task.shear_modulus * self.wire**4 / (8.0 * self.coils * self.coil**3)

    @property
    def free_length(self) -> float:
        """Length with touching coils [m]."""
        return self.coils * self.wire

    @property
    def stress(self) -> float:
        """Greatest shear stress at the design force [Pa]."""
        force, d = self.task.force, self.wire
        return 8.0 * force * self.coil / (math.pi * d**3) + 4.0 * force / (math.pi * d**2)

    @property
    def curved_stress(self) -> float:
        """Shear stress with Wahl's factor for the curvature of the wire [Pa]; for information."""
        index = self.coil / self.wire
        factor = (4.0 * index - 1.0) / (4.0 * index - 4.0) + 0.615 / index
        return 8.0 * self.task.force * self.coil / (math.pi * self.wire**3) * factor

    @property
    def safety(self) -> float:
        """Safety factor reached: strength / (sqrt 3 stress)."""
        return self.task.strength / (math.sqrt(3.0) * self.stress)

    @property
    def index(self) -> float:
        """Coil over wire diameter."""
        return self.coil / self.wire

    @property
    def feasible(self) -> bool:
        """Whether the stress and the spring index hold."""
        return (
            self.stress <= self.task.allowed_stress
            and INDEX_RANGE[0] <= self.index <= INDEX_RANGE[1]
        )

    @property
    def wire_volume(self) -> float:
        """Volume of the wire [m3]: what the spring costs and weighs."""
        return math.pi * self.coil * self.coils * math.pi * self.wire**2 / 4.0

    @property
    def torsional_stiffness(self) -> float:
        """Stiffness of both springs at the output shaft [N m/rad]: 2 K r^2."""
        return 2.0 * self.stiffness * (0.5 * self.task.guide_diameter) ** 2

    @property
    def rotation(self) -> float:
        """Rotation of the guide that extends the springs fully [rad]."""
        return self.task.extension / (0.5 * self.task.guide_diameter)

    def to_dict(self) -> dict[str, float | int | bool]:
        """Return what ``--json`` prints of it, in the units that the keys name."""
        return {
            "wire_mm": 1e3 * self.wire,
            "coil_mm": 1e3 * self.coil,
            "largest_coil_mm": 1e3 * self.task.largest_coil(self.wire),
            "coils": self.coils,
            "free_length_mm": 1e3 * self.free_length,
            "stiffness_N_per_mm": 1e-3 * self.stiffness,
            "stress_N_per_mm2": 1e-6 * self.stress,
            "curved_stress_N_per_mm2": 1e-6 * self.curved_stress,
            "allowed_stress_N_per_mm2": 1e-6 * self.task.allowed_stress,
            "safety": self.safety,
            "cable_force_N": self.task.cable_force,
            "torsional_stiffness_Nm_per_rad": self.torsional_stiffness,
            "rotation_rad": self.rotation,
            "wire_volume_cm3": 1e6 * self.wire_volume,
            "feasible": self.feasible,
        }

    def radial_force(self, mover: float) -> float:
        """Radial force on the gearbox [N] when the mover goes out by `mover` [m]: K dx."""
        return self.stiffness * mover


def design_spring(
    task: SpringTask | None = None, *, wire: float = 3e-3, coil: float = 34e-3
) -> SpringDesign:
    """Return the spring of a chosen wire and coil: as many coils as make it no stiffer than wanted.

    The defaults are the bench's choice: 3 mm wire, 34 mm coils, 342 of them.

    Raises
    ------
    RangeError
        Diameters that are not positive, or a coil smaller than its wire.
    """
    task = task or SpringTask()
    if not (math.isfinite(wire) and wire > 0.0 and math.isfinite(coil) and coil > wire):
        raise RangeError(
            f"spring: wire {1e3 * wire:g} mm, coil {1e3 * coil:g} mm: the coil must be the larger"
        )
    exact = task.shear_modulus * wire**4 / (8.0 * task.stiffness * coil**3)
    return SpringDesign(task, wire, coil, max(1, math.ceil(exact - 1e-9)))


def search_springs(task: SpringTask | None = None, *, longest: float = 1.1) -> list[SpringDesign]:
    """Return the feasible springs over standard wires, least wire first.

    Parameters
    ----------
    task : SpringTask, optional
        What they must do.
    longest : float
        Greatest free length [m]: what the tubes under the bench hold. ASSUMED 1.1: the chosen
        spring of 1.026 m fits them.

    Returns
    -------
    list of SpringDesign
        May be empty.
    """
    task = task or SpringTask()
    if not (math.isfinite(longest) and longest > 0.0):
        raise RangeError(f"spring: longest = {longest!r} must be above 0")
    designs = []
    for wire in STANDARD_WIRES:
        top = min(task.largest_coil(wire), INDEX_RANGE[1] * wire)
        first = math.ceil(INDEX_RANGE[0] * wire / _COIL_STEP - 1e-9)
        for k in range(first, math.floor(top / _COIL_STEP + 1e-9) + 1):
            design = design_spring(task, wire=wire, coil=k * _COIL_STEP)
            if design.feasible and design.free_length <= longest:
                designs.append(design)
    return sorted(designs, key=lambda design: design.wire_volume)


@dataclass(frozen=True, slots=True)
class SpringSizing:
    """A chosen spring judged, and the other designs that hold.

    Attributes
    ----------
    design : SpringDesign
        The chosen one.
    others : list of SpringDesign
        Feasible designs over standard wires, least wire first.
    mover : float
        Displacement of the mover [m] of which the radial force is stated.
    """

    design: SpringDesign
    others: list[SpringDesign]
    mover: float

    @property
    def feasible(self) -> bool:
        """Whether the chosen spring holds."""
        return self.design.feasible

    @property
    def radial_force(self) -> float:
        """Radial force on the gearbox [N] at the mover's displacement."""
        return self.design.radial_force(self.mover)

    def to_dict(self) -> dict[str, Any]:
        """Return status, checks, the chosen design and the others."""
        design, task = self.design, self.design.task
        low, high = INDEX_RANGE
        largest = task.largest_coil(design.wire)
        checks = (
            ("shear stress", design.stress / 1e6, task.allowed_stress / 1e6, "N/mm2",
             design.stress <= task.allowed_stress),
            ("coil diameter", 1e3 * design.coil, 1e3 * largest, "mm", design.coil <= largest),
            ("least spring index", design.index, low, "1", design.index >= low),
            ("greatest spring index", design.index, high, "1", design.index <= high),
        )  # fmt: skip
        keys = ("name", "value", "limit", "unit", "passed")
        return {
            "status": "pass" if self.feasible else "fail",
            "checks": [dict(zip(keys, check, strict=True)) for check in checks],
            "design": {**design.to_dict(), "radial_force_N": self.radial_force},
            "feasible": [item.to_dict() for item in self.others],
        }


def size_spring(
    *,
    wire: Quantity = "3 mm",
    coil: Quantity = "34 mm",
    torque: Quantity = "12 N m",
    guide: Quantity = "160 mm",
    force: Quantity = "80 N",
    extension: Quantity = "1.3 m",
    modulus: Quantity = "81500 N/mm2",
    strength: Quantity = "1730 N/mm2",
    safety: Quantity = "2",
    longest: Quantity = "1.1 m",
    mover: Quantity = "10 mm",
) -> SpringSizing:
    """Return a spring of the load module judged, and other designs that do as well.

    Parameters
    ----------
    wire : quantity
        Wire diameter.
    coil : quantity
        Mean coil diameter.
    torque : quantity
        Greatest torque on the gearbox.
    guide : quantity
        Diameter of the winding guide.
    force : quantity
        Design force of each spring.
    extension : quantity
        Extension at that force.
    modulus : quantity
        Shear modulus of the wire.
    strength : quantity
        Strength of the wire.
    safety : quantity
        Safety factor.
    longest : quantity
        Greatest free length of other designs.
    mover : quantity
        Displacement of the mover.

    Raises
    ------
    InputError
        A number that is not above 0, a force below what the torque needs, a wrong unit.
    """
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
        task, wire=parse_quantity(wire, "m", "--wire"), coil=parse_quantity(coil, "m", "--coil")
    )
    others = search_springs(task, longest=parse_quantity(longest, "m", "--longest"))
    return SpringSizing(chosen, others, parse_quantity(mover, "m", "--mover"))
