"""The other way round: the actuator is an FMU as well, and FMPy couples it to that controller."""

from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Slave
from run import session  # makes pi.fmu, and what it does in a session of Elevon

import elevon


def instance(name):
    """Return an initialised instance of NAME.fmu, and the value references of its variables."""
    description = fmpy.read_model_description(f"{name}.fmu")
    folder = fmpy.extract(f"{name}.fmu", unzipdir=str(Path(name).resolve()))
    made = FMU2Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=folder,
        instanceName=name,
    )
    made.instantiate()
    made.setupExperiment()
    made.enterInitializationMode()
    made.exitInitializationMode()
    return made, {item.name: [item.valueReference] for item in description.modelVariables}


options = {"fidelity": "low", "version": "2.0", "mode": "torque", "force": True}
elevon.export_fmu("torino-rotary", "plant.fmu", **options)
plant, of_plant = instance("plant")
pi, of_pi = instance("pi")
pi.setReal(of_pi["reference"], [200.0])
for k in range(300):
    pi.setReal(of_pi["speed"], plant.getReal(of_plant["motor_speed"]))
    pi.doStep(k * 1e-3, 1e-3)
    plant.setReal(of_plant["command"], pi.getReal(of_pi["torque"]))
    plant.doStep(k * 1e-3, 1e-3)
(speed,) = plant.getReal(of_plant["motor_speed"])
same = "the same bits" if speed == session["motor_speed"] else "other bits"
print(f"plant.fmu: {speed * 30 / 3.14159265:.1f} rpm of 200; {same} as the session")
