"""Files of one servo as other tools, drives and people write them; a few kB each, made here."""

import gzip
import io
import math
from dataclasses import dataclass, field

import numpy as np

RATIO = 50.0
RPM, DEG, REV = 30.0 / math.pi, 180.0 / math.pi, 0.5 / math.pi


@dataclass(frozen=True)
class Style:
    """How a file is written: columns as (header, signal, file's number for one of SI)."""

    columns: tuple
    separator: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    before: str = ""
    line_end: str = "\n"
    form: str = "%.7g"
    ending: str = "csv"
    units_below: tuple = ()
    answers: dict = field(default_factory=dict)
    drive: str | None = None
    about: str = ""


def servo():
    """Return the signals of a servo behind a gear, SI; with noise of an encoder and a resolver."""
    rng = np.random.default_rng(12)
    t = np.round(np.arange(0.0, 8.0, 0.004), 6)
    command = 0.6 * np.sin(1.7 * t + 0.4 * np.sin(0.9 * t)) + 0.15 * np.sin(5.3 * t)
    output = np.interp(t - 0.04, t, command)
    speed = RATIO * np.gradient(output, t)
    rate = np.gradient(np.convolve(np.pad(speed, 4, "edge"), np.ones(9) / 9.0, "valid"), t)
    current = 1.2 * np.tanh(2.0 * speed) + 0.03 * rate + 0.02 * speed
    signals = {
        "time": t,
        "command": command,
        "output_position": output + rng.normal(0.0, 2e-5, len(t)),
        "motor_position": RATIO * output + rng.normal(0.0, 1e-4, len(t)),
        "speed_ref": 20.0 * RATIO * (command - output),
        "motor_speed": speed + rng.normal(0.0, 0.02, len(t)),
        "torque_current": current + rng.normal(0.0, 0.01, len(t)),
        "temperature": 300.0 + 0.5 * t,
        "supply_voltage": 48.0 + rng.normal(0.0, 0.05, len(t)),
        "mode": np.full(len(t), 3.0),
    }
    signals["current_ref"] = np.interp(t + 0.004, t, current)
    return signals


def _of(time, command, output, speed, current, *more):
    roles = ("time", "command", "output_position", "motor_speed", "torque_current")
    given = (time, command, output, speed, current)
    return (*((h, r, f) for r, (h, f) in zip(roles, given, strict=True)), *more)


_MS, _S, _D, _R, _A = 1e3, 1.0, DEG, RPM, 1.0
STYLES = {
    "si-names": Style(_of(("time [s]", _S), ("command [rad]", 1.0), ("output_position [rad]", 1.0),
                          ("motor_speed [rad/s]", 1.0), ("torque_current [A]", _A))),
    "english-brackets": Style(_of(("Time [ms]", _MS), ("Position setpoint [deg]", _D),
                                  ("Actual position [deg]", _D), ("Motor speed [rpm]", _R),
                                  ("Motor current [A]", _A))),
    "english-parentheses": Style(_of(("time (s)", _S), ("target angle (deg)", _D),
                                     ("angle (deg)", _D), ("speed (rpm)", _R),
                                     ("current (mA)", 1e3))),
    "suffixes": Style(_of(("t_ms", _MS), ("pos_cmd_deg", _D), ("pos_deg", _D), ("speed_rpm", _R),
                          ("i_q_A", _A))),
    "german-export": Style(_of(("Zeit [ms]", _MS), ("Soll_Winkel [°]", _D), ("Ist_Winkel [°]", _D),
                               ("Drehzahl [1/min]", _R), ("Strom [A]", _A)),
                           separator=";", decimal=",", encoding="latin-1",
                           before="Datum;12.03.2025\nPrüfling;EMA-07\n"),
    "german-per-minute": Style(_of(("Zeit [s]", _S), ("Lagesoll [Grad]", _D),
                                   ("Lageist [Grad]", _D), ("Istdrehzahl [U/min]", _R),
                                   ("Iststrom [A]", _A)),
                               separator="\t", decimal=","),
    "italian": Style(_of(("tempo [s]", _S), ("angolo comando [gradi]", _D), ("angolo [gradi]", _D),
                         ("velocità motore [giri/min]", _R), ("corrente [A]", _A)),
                     separator=";", encoding="utf-8-sig"),
    "french": Style(_of(("temps [s]", _S), ("consigne angle [deg]", _D), ("angle mesuré [deg]", _D),
                        ("vitesse moteur [tr/min]", _R), ("courant [A]", _A)),
                    separator=";", decimal=",", encoding="cp1252"),
    "spanish": Style(_of(("tiempo [s]", _S), ("ángulo consigna [deg]", _D), ("ángulo [deg]", _D),
                         ("velocidad motor [rpm]", _R), ("corriente [A]", _A))),
    "units-in-a-row": Style(_of(("Time", _MS), ("Demand", _D), ("Position", _D), ("Speed", _R),
                                ("Current", _A)), units_below=("ms", "deg", "deg", "rpm", "A")),
    "utf-16": Style(_of(("Zeit [s]", _S), ("Sollwert Winkel [°]", _D), ("Istwert Winkel [°]", _D),
                        ("Motordrehzahl [1/min]", _R), ("Motorstrom [A]", _A)),
                    separator="\t", encoding="utf-16"),
    "gzip": Style(_of(("time_s", _S), ("command_deg", _D), ("position_deg", _D), ("speed_rpm", _R),
                      ("current_A", _A)), ending="csv.gz"),
    "blanks": Style(_of(("t_s", _S), ("pos_ref_rad", 1.0), ("pos_rad", 1.0), ("vel_rad_s", 1.0),
                        ("cur_A", _A)), separator=" ", ending="txt"),
    "percent-comments": Style(_of(("time[s]", _S), ("theta_ref[rad]", 1.0), ("theta[rad]", 1.0),
                                  ("omega[rad/s]", 1.0), ("iq[A]", _A)),
                              before="% bench 3\n% recorded by hand\n"),
    "hash-comments": Style(_of(("timestamp [s]", _S), ("reference position [rad]", 1.0),
                               ("position [rad]", 1.0), ("rotor velocity [rad/s]", 1.0),
                               ("measured current [A]", _A)),
                           before="# kt = 0.11\n# g = 50.0\n# User comment:\n"),
    "crlf-and-mark": Style(_of(("Time [s]", _S), ("Cmd Pos [deg]", _D), ("Act Pos [deg]", _D),
                               ("Act Vel [rpm]", _R), ("Act Curr [A]", _A)),
                           line_end="\r\n", encoding="utf-8-sig"),
    "exponents": Style(_of(("t [s]", _S), ("ref [rad]", 1.0), ("y [rad]", 1.0), ("w [rad/s]", 1.0),
                           ("i [A]", _A)), form="%.8e"),
    "stamps": Style(_of(("Time (ms)", _MS), ("Desired Position (deg)", _D),
                        ("Position (deg)", _D), ("Velocity (deg/s)", _D),
                        ("motorCurrent (mA)", 1e3)), about="board of a student's bench"),
    "microseconds": Style(_of(("TimeUS [us]", 1e6), ("PosCmd [deg]", _D), ("Pos [deg]", _D),
                              ("Speed [rpm]", _R), ("Curr [A]", _A), ("MotT [degC]", "", 0.0)),
                          about="servo telemetry of an autopilot"),
    "drive-with-state": Style(_of(("Time [s]", _S), ("Target position [deg]", _D),
                                  ("Actual position [deg]", _D), ("Actual velocity [rpm]", _R),
                                  ("Actual current [mA]", 1e3), ("Mode", "mode", 1.0)),
                              about="positioning controller's scope"),
    "two-references": Style(_of(("Time [s]", _S), ("Target position [deg]", _D),
                                ("Actual position [deg]", _D), ("Actual velocity [rpm]", _R),
                                ("Actual current [A]", _A),
                                ("Target velocity [rpm]", "speed_ref", _R),
                                ("Target current [A]", "current_ref", _A))),
    "both-shafts": Style(_of(("t [s]", _S), ("cmd [deg]", _D), ("flap angle [deg]", _D),
                             ("motor speed [rpm]", _R), ("iq [A]", _A),
                             ("motor angle [rev]", "motor_position", REV))),
    "shuffled": Style(tuple(_of(("Time [s]", _S), ("Setpoint [deg]", _D), ("Feedback [deg]", _D),
                                ("Speed [rpm]", _R), ("Current [A]", _A))[k]
                            for k in (4, 2, 0, 3, 1))),
    "supply-and-heat": Style(_of(("time [s]", _S), ("demand [deg]", _D), ("actual [deg]", _D),
                                 ("motor speed [rpm]", _R), ("motor current [A]", _A),
                                 ("DC bus voltage [V]", "supply_voltage", 1.0))),
    "nonsense-with-units": Style(_of(("foo [s]", _S), ("bar [deg]", _D), ("baz [deg]", _D),
                                     ("qux [rpm]", _R), ("quux [A]", _A))),
    "letters-with-units": Style(_of(("A [ms]", _MS), ("B [rad]", 1.0), ("C [rad]", 1.0),
                                    ("D [rad/s]", 1.0), ("E [A]", _A))),
    "moteus": Style(_of(("time [s]", _S), ("command position [rev]", REV), ("position [rev]", REV),
                        ("velocity [rad/s]", 1.0), ("q_current [A]", _A)),
                    about="open motor controller"),
    "feedback-logger": Style(_of(("time (s)", _S), ("target (deg)", _D), ("position (deg)", _D),
                                 ("velocity (rpm)", _R), ("current (A)", _A),
                                 ("motor_id", "mode", 1.0)), about="logger of a robot's actuators"),
    "two-drives": Style((("time [s]", "time", 1.0), ("a1 command [deg]", "command", _D),
                         ("a1 position [deg]", "output_position", _D),
                         ("a1 velocity [rpm]", "motor_speed", _R),
                         ("a1 current [A]", "torque_current", 1.0),
                         ("a2 command [deg]", "", 0.0), ("a2 position [deg]", "", 0.0),
                         ("a2 velocity [rpm]", "", 0.0), ("a2 current [A]", "", 0.0)),
                        drive="a1", about="dynamometer with two drives"),
    "robot-benchmark": Style((("t", "time", 1.0), ("qg", "command", 1.0),
                              ("qm", "output_position", 1.0), ("vir", "effort", 1.0)),
                             answers={"output_position": "qm [rad]", "effort": "vir [V]"},
                             about="public benchmark of identification, without units"),
    "own-roles-no-units": Style(_of(("time", _S), ("command", 1.0), ("output_position", 1.0),
                                    ("motor_speed", 1.0), ("torque_current", _A))),
    "matlab": Style(_of(("time_s", _S), ("pos_ref_deg", _D), ("pos_deg", _D), ("speed_rpm", _R),
                        ("current_A", _A)), ending="mat"),
    "parquet": Style(_of(("Time [s]", _S), ("Set position [deg]", _D), ("Act position [deg]", _D),
                         ("Motor speed [rpm]", _R), ("Torque current [A]", _A)), ending="parquet"),
    "thousands": Style(_of(("Zeit [ms]", _MS), ("Sollwinkel [°]", _D), ("Istwinkel [°]", _D),
                           ("Drehzahl [U/min]", _R), ("Strom [mA]", 1e3)),
                       separator=";", decimal=",", form="thousands"),
}  # fmt: skip


def values_of(style, signals):
    """Return header to the file's numbers."""
    effort = 3.0 * signals["torque_current"]
    out = {}
    for header, signal, factor in style.columns:
        base = effort if signal == "effort" else signals.get(signal, np.zeros(len(signals["time"])))
        out[header] = np.asarray(base) * (factor or 0.0)
    return out


def write(path, style, signals):
    """Write a style's file; return its path."""
    values = values_of(style, signals)
    file = path / f"log.{style.ending}"
    if style.ending == "mat":
        from scipy.io import savemat

        savemat(file, {name.replace(" ", "_"): v for name, v in values.items()})
        return file
    if style.ending == "parquet":
        import pandas

        pandas.DataFrame(values).to_parquet(file)
        return file
    text = io.StringIO()
    text.write(style.before)
    text.write(style.separator.join(values) + "\n")
    if style.units_below:
        text.write(style.separator.join(style.units_below) + "\n")
    for row in np.column_stack(list(values.values())):
        cells = [f"{x:,.5f}" if style.form == "thousands" else style.form % x for x in row]
        if style.form == "thousands":
            cells = [c.replace(",", "\0").replace(".", ",").replace("\0", ".") for c in cells]
        elif style.decimal != ".":
            cells = [c.replace(".", style.decimal) for c in cells]
        text.write(style.separator.join(cells) + "\n")
    data = text.getvalue().replace("\n", style.line_end).encode(style.encoding)
    file.write_bytes(gzip.compress(data) if style.ending.endswith("gz") else data)
    return file
