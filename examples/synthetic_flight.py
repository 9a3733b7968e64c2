"""Make a short synthetic flight, and the load it puts on a ballscrew actuator.

Climb from 1500 m to 4500 m, a level acceleration, three aileron doublets and a roll at constant
rate. Everything follows from a few formulas (no random numbers), so the file is always the same.

    python examples/synthetic_flight.py flight.csv
"""

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt

from elevon.files import write_text
from elevon.loads import HingeMoment, LoadTable, flight_load, read_flight

HEADER = "time [s],altitude [m],true_airspeed [m/s],angle_of_attack [deg],deflection [deg]"
SURFACE = HingeMoment(
    area=0.9, chord=0.45, c_alpha=-0.12, c_delta=-0.42
)  # a jet's aileron, assumed
ARM = 0.09  # m, lever between hinge and ram, assumed
RAM_LIMIT = 8750.0  # N, the test actuator's largest continuous load
RAM_TRAVEL = 0.05  # m

Array = npt.NDArray[np.float64]


def synthetic_flight() -> Array:
    """Return the flight, one row a sample at 20 Hz, in the columns of `HEADER`."""
    time = np.arange(0.0, 60.0 + 0.025, 0.05)
    climb = np.clip(time / 25.0, 0.0, 1.0)
    altitude = 1500.0 + 3000.0 * climb**2 * (3.0 - 2.0 * climb)
    airspeed = 140.0 + 90.0 / (1.0 + np.exp(-(time - 30.0) / 4.0))
    load_factor = 1.0 + 0.15 * np.sin(2.0 * np.pi * time / 12.0)
    alpha = 9.0 * load_factor * (140.0 / airspeed) ** 2
    deflection = np.zeros_like(time)
    for start, size in ((8.0, 6.0), (22.0, 10.0), (40.0, 14.0)):
        deflection += _doublet(time - start, size)
    deflection += 8.0 * _pulse((time - 50.0) / 6.0)
    return np.column_stack([time, altitude, airspeed, alpha, deflection])


def write_flight(path: str | Path, *, force: bool = False) -> None:
    """Write the flight as a CSV file with units in its header."""
    rows = "\n".join(",".join(f"{value:.6g}" for value in row) for row in synthetic_flight())
    write_text(path, f"# synthetic flight, no aircraft\n{HEADER}\n{rows}\n", force=force)


def ram_load(path: str | Path) -> LoadTable:
    """Return the load of the written flight, scaled to the ballscrew actuator."""
    return flight_load(read_flight(path), SURFACE, arm=ARM, limit=RAM_LIMIT, travel=RAM_TRAVEL)


def _doublet(time: Array, size: float, period: float = 4.0) -> Array:
    active = (time >= 0.0) & (time <= period)
    wave = np.sin(2.0 * np.pi * time / period)
    return np.asarray(np.where(active, size * np.sign(wave) * np.abs(wave) ** 1.5, 0.0))


def _pulse(phase: Array) -> Array:
    active = (phase >= 0.0) & (phase <= 1.0)
    return np.asarray(np.where(active, np.sin(np.pi * phase) ** 2, 0.0))


def main() -> None:
    """Write the file and print what the actuator would feel."""
    parser = argparse.ArgumentParser(description="synthetic flight for the ballscrew actuator")
    parser.add_argument("output", type=Path)
    parser.add_argument("--force", action="store_true", help="replace an existing file")
    arguments = parser.parse_args()
    write_flight(arguments.output, force=arguments.force)
    table = ram_load(arguments.output)
    print(f"{table.time.size} samples, {table.time[-1]:g} s, Mach up to {table.mach.max():.3f}")
    print(f"dynamic pressure up to {table.dynamic_pressure.max() / 1e3:.2f} kPa")
    print(f"load {table.load.min():.0f} to {table.load.max():.0f} N (scale {table.load_scale:.3f})")


if __name__ == "__main__":
    main()
