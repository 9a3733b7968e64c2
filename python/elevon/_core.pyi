"""The Rust core: all physics. Every number crossing this seam is an SI float."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = [
    "check",
    "derivatives_per_pass",
    "faults",
    "feature_records",
    "feature_roles",
    "features",
    "initial",
    "not_acting",
    "parameters",
    "ports",
    "profiles",
    "roles",
    "sensitivities",
    "signals",
    "simulate",
    "version",
    "waveform",
    "waveforms",
    "widths",
    "wirings",
]

def version() -> str: ...
def wirings() -> list[dict[str, Any]]: ...
def parameters(wiring: str) -> list[dict[str, Any]]: ...
def signals(wiring: str, fidelity: str) -> list[dict[str, Any]]: ...
def roles() -> list[dict[str, Any]]: ...
def ports(wiring: str) -> list[dict[str, Any]]: ...
def initial(wiring: str, fidelity: str) -> list[str]: ...
def faults(wiring: str) -> list[dict[str, Any]]: ...
def waveform(
    kind: str, parameters: list[float], time: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]: ...
def derivatives_per_pass() -> int: ...
def waveforms() -> list[dict[str, Any]]: ...
def profiles() -> list[dict[str, Any]]: ...
def check(
    wiring: str, fidelity: str, parameters: npt.NDArray[np.float64]
) -> list[dict[str, Any]]: ...
def not_acting(
    wiring: str,
    fidelity: str,
    parameters: npt.NDArray[np.float64],
    faults: list[dict[str, Any]],
    paths: list[str] | None = None,
) -> list[dict[str, str]]: ...
def widths() -> dict[str, Any]: ...
def feature_records() -> list[dict[str, Any]]: ...
def feature_roles() -> list[dict[str, str]]: ...
def features(
    plan: dict[str, Any], columns: list[npt.NDArray[np.float64]]
) -> npt.NDArray[np.float64]: ...
def simulate(
    wiring: str,
    fidelity: str,
    runs: list[dict[str, Any]],
    record: list[dict[str, Any]],
    threads: int = 0,
    lanes: str = "auto",
    progress: Callable[[float], bool] | None = None,
) -> list[dict[str, Any]]: ...
def sensitivities(
    wiring: str,
    fidelity: str,
    run: dict[str, Any],
    record: list[dict[str, Any]],
    parameters: list[str],
    faults: list[int],
    progress: Callable[[float], bool] | None = None,
) -> list[dict[str, Any]]: ...
