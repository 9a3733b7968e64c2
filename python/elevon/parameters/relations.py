"""Relations between parameters that hold in every wiring: each is written here and nowhere else.

Currents are peak values of the phase (amplitude-invariant transformation), so a machine of three
phases gives 3/2 of its flux as torque per ampere, and copper losses of 3/2 R i^2.
"""

from __future__ import annotations

from typing import Protocol

TORQUE_PER_FLUX = 1.5
"""Torque constant over back-EMF constant, peak values of a three-phase machine."""

_LEAST = 1e-300


class _Values(Protocol):
    """What holds parameters: `ParameterSet`."""

    def value(self, path: str) -> float:
        """Return one number in SI."""
        ...


def torque_constant(emf_constant: float, flux_fraction: float = 1.0) -> float:
    """Return the torque constant [N m/A] of a back-EMF constant [V s/rad], both peak."""
    return TORQUE_PER_FLUX * emf_constant * flux_fraction


def emf_constant(torque_constant: float, flux_fraction: float = 1.0) -> float:
    """Return the back-EMF constant [V s/rad] behind a torque constant [N m/A], both peak."""
    return torque_constant / TORQUE_PER_FLUX / flux_fraction


def motor_torque_constant(parameters: _Values) -> float:
    """Return an actuator's torque constant [N m/A], with the magnets as they are."""
    value = parameters.value
    return torque_constant(value("motor.emf_constant"), value("motor.flux_fraction"))


def constant_is_tied(parameters: _Values, tolerance: float) -> bool:
    """Return whether the controller's torque constant is the motor's, within a tolerance."""
    motor = motor_torque_constant(parameters)
    constant = parameters.value("control.torque_constant")
    return motor > 0.0 and abs(constant / motor - 1.0) < tolerance


def static_following(parameters: _Values, dynamic: float) -> float:
    """Return the static friction that belongs to a dynamic one: the file's ratio, at least 1."""
    static, old = parameters.value("friction.static"), parameters.value("friction.dynamic")
    return max(static / max(old, _LEAST), 1.0) * dynamic


def copper_loss(resistance: float, current: float) -> float:
    """Return the heat [W] of a phase resistance [ohm] and a peak current vector [A]."""
    return TORQUE_PER_FLUX * resistance * current**2
