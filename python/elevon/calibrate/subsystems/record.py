"""What logs determine of each subsystem, as numbers of an actuator file and of the axis itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

from elevon.actuator import Actuator
from elevon.calibrate.named import named
from elevon.calibrate.stages.context import (
    LAWS_WITHOUT_LOAD,
    LOAD_SHARE,
    grows_with_torque,
    motor_ratio,
)
from elevon.calibrate.subsystems.controller import Controller
from elevon.calibrate.subsystems.electrics import Determination
from elevon.calibrate.subsystems.mechanics import LOSS, SHARE, Mechanics
from elevon.calibrate.subsystems.signals import Effort, linear
from elevon.estimate import Estimate
from elevon.parameters.records import records
from elevon.plain import REMAINDER, Plain

NAMES = ("mechanics", "electrics", "transmission", "thermal", "controller")
IDENTIFIED, PARTIAL, NOT = "identified", "partial", "not_identified"
#: Paths by their subsystem, where a fit of the whole gives them.
_HOMES = {
    "electrics": ("motor.winding", "motor.emf", "inverter.", "pwm.", "motor.torque"),
    "transmission": ("backlash.", "gear.ratio", "sensor.encoder.", "gear.mesh", "gear.tooth"),
    "thermal": ("thermal.", "screw.nut_"),
    "controller": ("control.", "sensor.filter"),
    "mechanics": ("motor.inertia", "friction.", "load.", "screw.", "gear.", "lock.", "brake."),
}


@dataclass(frozen=True)
class Subsystem(Plain):
    """One subsystem.

    Attributes
    ----------
    status : str
        ``identified``, ``partial`` or ``not_identified``.
    parameters : mapping of str to Estimate
        By name.
    reason : str
        Why it is not identified, or only partly.
    more : mapping of str to object
        How it was done, plain types.
    """

    status: str
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    reason: str = ""
    more: Annotated[Mapping[str, Any], REMAINDER] = field(default_factory=dict)

    def joined_with(self, other: Subsystem) -> Subsystem:
        """Return it with what another way determines of the same subsystem under its own names."""
        more = {f"by_regression.{name}": item for name, item in other.parameters.items()}
        status = max(self.status, other.status, key=(NOT, PARTIAL, IDENTIFIED).index)
        return replace(self, status=status, parameters={**self.parameters, **more}, more=other.more)


def of_registers(estimates: Sequence[Estimate], missing: Mapping[str, str]) -> dict[str, Subsystem]:
    """Return the subsystems of a fit of the whole, by the paths that it determined."""
    out = {}
    for name in NAMES:
        known = {e.path: e for e in estimates if _home(e.path) == name and e.in_set}
        lacking = {path: why for path, why in missing.items() if _home(path) == name}
        status = NOT if not known else PARTIAL if lacking else IDENTIFIED
        reason = next(iter(lacking.values()), "" if known else "nothing in the logs shows it")
        out[name] = Subsystem(status, known, reason)
    return out


def _home(path: str) -> str:
    return next((n for n, heads in _HOMES.items() if path.startswith(heads)), "")


@dataclass(frozen=True)
class ReportAxis:
    """The coordinate of what is reported: a linear axis's output, else the motor's shaft.

    Attributes
    ----------
    ratio : float
        Motor's angle over the axis's coordinate.
    torque, place : str
        Units of its effort and coordinate.
    inertia : str
        Name of what it moves.
    """

    ratio: float
    torque: str
    place: str
    inertia: str

    @classmethod
    def of(cls, actuator: Actuator, effort: Effort) -> ReportAxis:
        """Return the axis of an actuator; in the effort's unit where its scale is not known."""
        moves = linear(actuator)
        torque = ("N" if moves else "N m") if effort.known else effort.unit
        ratio = motor_ratio(actuator) if moves else 1.0
        return cls(ratio, torque, "m" if moves else "rad", "mass" if moves else "inertia")

    def number(self, item: Estimate, name: str) -> Estimate:
        """Return a number of the motor's shaft in this coordinate, with its unit."""
        power = {"inertia": 2, "viscous": 2, "coulomb": 1, "offset": 1, LOSS: 0}[name]
        if power and self.torque not in {"N", "N m"}:  # an effort is one in any coordinate
            power -= 1
        moved = f"{self.torque} s2/{self.place}"
        unit = {
            "inertia": {"N": "kg", "N m": "kg m2"}.get(self.torque, moved),
            "viscous": f"{self.torque} s/{self.place}",
            LOSS: "1",
        }.get(name, self.torque)
        path = f"derived.{self.inertia if name == 'inertia' else name}"
        return replace(
            item.scaled(self.ratio**power), path=path, unit=unit, register="plant", in_set=False
        )


def mechanics_of(
    result: Mechanics, actuator: Actuator, effort: Effort
) -> tuple[Subsystem, list[Estimate], dict[str, str], dict[str, str | float]]:
    """Return the mechanics, what goes into the actuator file, what is not determined, and choices.

    Where a share of the effort is lost, the choices are those of the law of friction that loses it.
    """
    axis = ReportAxis.of(actuator, effort)
    names = [name for name in result.regression.names if result.determined(name)]
    axis_numbers = {}
    for name in result.regression.names:
        item = result.estimate(name)
        if item is not None:
            axis_numbers[axis.inertia if name == "inertia" else name] = axis.number(item, name)
    axis_numbers |= _ratios(result, axis)
    missing = {
        name: f"its deviation is {100 * abs(item.std / item.value):.0f} % of it"
        for name in result.regression.names
        if name not in names and (item := result.estimate(name)) is not None and item.value
    }
    if result.direction:
        missing["load"] = "nothing reverses: only the sum of friction and load is determined"
    written: list[Estimate] = []
    if effort.known:
        written = _plant(result, names, actuator, effort)
        carried = {"motor.inertia", "load.inertia", "load.mass"} & {item.path for item in written}
        if "inertia" in names and not carried:
            missing["inertia"] = (
                "what turns beside the motor, as given, is more than all that turns: correct "
                "load.inertia or load.mass, gear.inertia and screw.inertia"
            )
    else:
        missing["scale"] = (
            f"the effort is a {effort.unit or 'number'} of unknown scale: numbers are in its unit; "
            "--set motor.torque_constant=... gives them in SI"
        )
    whole = not missing and "inertia" in names
    status = IDENTIFIED if whole else PARTIAL if names else NOT
    more = {
        "band_hz": result.band, "method": result.method, "explained": result.regression.explained,
        "confounded_and_seen": list(result.findings), "effort": effort.role,
        "separate": result.separate, "friction_curve": result.curve.tolist(),
        "residual": {name: table.tolist() for name, table in result.residual.items()},
    }  # fmt: skip
    reason = "; ".join(f"{name}: {why}" for name, why in missing.items())
    values: dict[str, str | float] = {}
    if written and LOSS in result.regression.names and _loses(actuator):
        # The other numbers hold beside it, whether it is determined or only possible.
        values = grows_with_torque(result.top_speed) | {LOAD_SHARE: result.regression[LOSS]}
    return Subsystem(status, axis_numbers, reason, more), written, _undetermined(missing), values


def _loses(actuator: Actuator) -> bool:
    """Return whether the law of friction can be exchanged for one that grows with the torque."""
    known = actuator.parameters
    return LOAD_SHARE in known and str(known["friction.law"].value) in LAWS_WITHOUT_LOAD


def _undetermined(missing: Mapping[str, str]) -> dict[str, str]:
    paths = {
        "inertia": "motor.inertia", "viscous": "friction.viscous", "coulomb": "friction.dynamic",
        "offset": "load.constant", "load": "load.constant", LOSS: LOAD_SHARE,
    }  # fmt: skip
    return {paths[name]: why for name, why in missing.items() if name in paths}


def _ratios(result: Mechanics, axis: ReportAxis) -> dict[str, Estimate]:
    """Return what is known whatever the scale of the effort: numbers over the inertia."""
    out, names = {}, result.regression.names
    units = {"viscous": "1/s", "coulomb": f"{axis.place}/s2", "offset": f"{axis.place}/s2"}
    for name in [name for name in names[1:] if name != LOSS]:
        at = names.index(name)
        item = _over_inertia(result, at)
        factor = 1.0 if name == "viscous" else 1.0 / axis.ratio
        path = f"derived.{name}_per_{axis.inertia}"
        if item.std < SHARE * abs(item.value):
            out[f"{name}_per_{axis.inertia}"] = replace(
                item.scaled(factor), path=path, unit=units[name], register="plant", in_set=False
            )
    return out


def _over_inertia(result: Mechanics, at: int) -> Estimate:
    return result.regression.of(lambda b: float(b[at] / b[0]))


def _plant(
    result: Mechanics, names: Sequence[str], actuator: Actuator, effort: Effort
) -> list[Estimate]:
    """Return the numbers as parameters; what else turns and rubs as given is taken off."""
    known, value, ratio = actuator.parameters, actuator.parameters.value, motor_ratio(actuator)
    parts = {
        "gear.inertia": 1.0, "screw.inertia": 1.0 / value("gear.ratio") ** 2,
        "load.inertia": ratio**-2.0, "load.mass": ratio**-2.0,
    }  # fmt: skip
    others = {p: f * value(p) for p, f in parts.items() if p in known}
    out = []

    def add(name: str, path: str, less: float, factor: float, given: tuple[str, ...]) -> None:
        item = result.estimate(name)
        if item is None or name not in names or path not in records(actuator.wiring):
            return
        shifted = Estimate((item.value - less) * factor, item.std * abs(factor), item.degrees)
        if name == "offset" or shifted.value > 0.0:
            out.append(named(shifted, path, actuator, given=(*effort.given, *given)))

    load = next((p for p in ("load.inertia", "load.mass") if p in others), None)
    other_inertia = sum(others.values())
    if load is not None and others[load] > value("motor.inertia"):
        less = other_inertia - others[load] + value("motor.inertia")
        add("inertia", load, less, 1.0 / parts[load], ("motor.inertia",))
    else:
        add(
            "inertia",
            "motor.inertia",
            other_inertia,
            1.0,
            tuple(p for p, v in others.items() if v > 0.0),
        )
    if _loses(actuator):
        add(LOSS, LOAD_SHARE, 0.0, 1.0, ())
    damping = value("load.damping") / ratio**2 if "load.damping" in known else 0.0
    add("viscous", "friction.viscous", damping, 1.0, ("load.damping",) if damping else ())
    rubbing = value("load.friction") / abs(ratio) if "load.friction" in known else 0.0
    preloaded = "screw.preload" in known and value("screw.preload") > 0.0
    if not preloaded:  # the preload's friction cannot be told from the bearings'
        add("coulomb", "friction.dynamic", rubbing, 1.0, ("load.friction",) if rubbing else ())
    if result.direction and not preloaded:  # one sum: friction's share follows from the load's
        sign, load_given = result.direction, value("load.constant") / ratio
        item = result.estimate("offset")
        if item is not None and "offset" in names:
            rest_of_it = max(sign * (item.value - load_given) - rubbing, 0.0)
            dry = Estimate(rest_of_it, item.std, item.degrees)
            given = (*effort.given, "load.constant")
            out.append(named(dry, "friction.dynamic", actuator, given=given))
    else:
        add("offset", "load.constant", 0.0, ratio, ())
    return out


def electrics_of(
    result: Determination, cell: Determination, actuator: Actuator, unit: str
) -> tuple[Subsystem, list[Estimate]]:
    """Return the electrics, and what goes into the actuator file.

    A torque constant that a load cell gives is reported: it scales what other logs show.
    """
    constants = {
        name: replace(item, path="derived.torque_constant", unit=f"N m/{unit or '1'}", in_set=False)
        for name, item in cell.numbers.items()
    }
    if not result.numbers:
        return Subsystem(PARTIAL if constants else NOT, constants, result.reason), []
    paths = {
        "resistance": "motor.winding_resistance", "inductance": "motor.winding_inductance",
        "emf": "motor.emf_constant",
    }  # fmt: skip
    good = {
        name: item for name, item in result.numbers.items()
        if item.value > 0.0 and item.std < SHARE * item.value
    }  # fmt: skip
    written = [named(good[n], p, actuator) for n, p in paths.items() if n in good]
    whole = len(written) == len(paths)
    status = IDENTIFIED if whole else PARTIAL if written else NOT
    reported = constants | {item.path: item for item in written}
    if "drop" in good:
        reported["drop"] = replace(
            good["drop"], path="derived.voltage_drop", unit="V", in_set=False
        )
    reason = "" if whole else "current, its change and the speed do not vary apart enough"
    return Subsystem(status, reported, reason, {"explained": result.explained}), written


def transmission_of(result: Determination, actuator: Actuator) -> Subsystem:
    """Return the transmission: reported, not written, for the ratio is exact by its teeth."""
    if not result.numbers:
        return Subsystem(NOT, reason=result.reason)
    place = "m" if linear(actuator) else "rad"
    units = {"ratio": f"rad/{place}", "ratio_of_given": "1"}
    reported = {
        name: replace(item, path=f"derived.{name}", unit=units.get(name, place), in_set=False)
        for name, item in result.numbers.items()
    }
    ratio = result.numbers["ratio"]
    status = IDENTIFIED if ratio.std < 0.01 * abs(ratio.value) else PARTIAL
    return Subsystem(status, reported, "", {"explained": result.explained})


def controller_of(
    result: Controller | None, why: str, actuator: Actuator, effort: Effort
) -> tuple[Subsystem, list[Estimate], dict[str, str | float]]:
    """Return the controller, what goes into the actuator file, and its structure."""
    if result is None:
        return Subsystem(NOT, reason=why), [], {}
    more: dict[str, Any] = {
        "structure": result.structure, "of": result.of, "explained": result.held_out,
        "speed": result.speed.text, "delay_samples": result.delay, "sample_time_s": result.period,
        "limit": result.limit, "tried": dict(result.tried), "exact": result.exact,
    }  # fmt: skip
    if not result.identified:
        text = (
            f"no structure explains {100 * 0.9:.0f} % of the effort on data held out (the best, "
            f"{result.structure}, {100 * max(result.held_out, 0.0):.0f} %)"
        )
        return Subsystem(NOT, reason=text, more=more), [], {}
    ratio = motor_ratio(actuator) if linear(actuator) else 1.0
    place = "m" if linear(actuator) else "rad"
    unit = effort.unit or "1"
    units = {
        "position_gain": "1/s", "speed_gain": f"{unit} s/{place}", "integral_time": "s",
        "derivative_time": "s", "speed_feedforward": "1", "integral_gain": f"{unit}/({place} s)",
        "gain": "1" if result.of == "effort" else f"{unit}/{place}",
        "acceleration_feedforward": f"{unit} s2/{place}",
    }  # fmt: skip
    reported = {}
    for name, item in result.gains().items():
        factor = ratio if units[name].endswith((f"/{place}", f"({place} s)")) else 1.0
        reported[name] = replace(
            item.scaled(factor), path=f"derived.{name}", unit=units[name],
            register="controller", in_set=False,
        )  # fmt: skip
    if result.disturbance is not None:
        more["load_acts_on_the_output"] = True
        reported["load_gain"] = replace(
            result.disturbance, path="derived.load_gain", unit=f"{unit} a unit of the load",
            register="controller", in_set=False,
        )  # fmt: skip
    if not (result.exact and effort.known and result.of == "position"):
        return Subsystem(IDENTIFIED, reported, "", more), [], {}
    written, values = _written_gains(result, actuator, effort)
    return Subsystem(IDENTIFIED, reported, "", more), written, values


def _written_gains(
    result: Controller, actuator: Actuator, effort: Effort
) -> tuple[list[Estimate], dict[str, str | float]]:
    """Return gains as the model's parameters, and the choices that go with them."""
    gains, per_output, scale = result.gains(), motor_ratio(actuator), effort.scale
    if "speed" in result.terms and result.structure in {"P-P", "P-PI"}:
        paths = {
            "control.position_gain": ("position_gain", per_output),
            "control.speed_gain": ("speed_gain", scale),
            "control.integral_time": ("integral_time", 1.0),
            "control.speed_feedforward": ("speed_feedforward", 1.0),
        }
        values: dict[str, str | float] = {"control.structure": "cascade"}
        values |= {
            path: 0.0 for path, (name, _) in paths.items()
            if name not in gains and path in actuator.parameters
        }  # fmt: skip
    elif result.structure in {"P", "PI", "PD", "PID"} and not result.terms[-1].endswith("ahead"):
        paths = {
            "control.pid_gain": ("gain", scale * per_output),
            "control.pid_integral_time": ("integral_time", 1.0),
            "control.pid_derivative_time": ("derivative_time", 1.0),
        }
        values = {"control.structure": "pid"}
    else:
        return [], {}
    values["control.sample_time"] = result.period
    known = records(actuator.wiring)
    written = [
        named(gains[name].scaled(factor), path, actuator, given=effort.given)
        for path, (name, factor) in paths.items()
        if name in gains and path in known
    ]
    return written, {path: value for path, value in values.items() if path in known}
