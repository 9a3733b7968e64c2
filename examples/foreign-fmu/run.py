"""A speed controller from another tool, an FMU made of C, drives the reduced-order model."""

import subprocess
import zipfile
from pathlib import Path

import elevon

HERE = Path(__file__).parent
build = ["cc", "-shared", "-fPIC", "-o", "pi.so", str(HERE / "pi.c"), "-lm"]
subprocess.run(build, check=True)  # noqa: S603 - the reader's own compiler
with zipfile.ZipFile("pi.fmu", "w") as fmu:
    fmu.write(HERE / "modelDescription.xml", "modelDescription.xml")
    fmu.write("pi.so", "binaries/linux64/pi.so")

pi = elevon.Fmu(
    "pi.fmu", {"speed": "motor_speed", "reference": 200.0, "torque": "command"}, trust=True
)
session = elevon.Session("torino-rotary", fidelity="low", mode="torque", controller=pi)
session.advance("300 ms")
print(f"{session['motor_speed'] * 30 / 3.14159265:.1f} rpm of 200")
