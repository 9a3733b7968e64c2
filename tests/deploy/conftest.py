"""FMUs are exported once a session and unpacked."""

import pytest

from elevon.deploy import export_fmu
from tests.deploy.driver import Component, Fmu

GEAR = "pisa-landing-gear"


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    """Return a function that exports an actuator, once, and unpacks it."""
    made = {}

    def export(name, fidelity, version, **options):
        key = (name, fidelity, version, *options.items())
        if key not in made:
            folder = tmp_path_factory.mktemp("fmu")
            file = export_fmu(name, folder / "a.fmu", fidelity=fidelity, version=version, **options)
            made[key] = (file, Fmu(file.path, folder / "unpacked"))
        return made[key]

    return export


@pytest.fixture
def component(exported):
    """Return a function that makes instances, which are freed at the end."""
    instances = []

    def make(name="torino-rotary", fidelity="low", version="3.0", **options):
        _, fmu = exported(name, fidelity, version)
        instances.append(Component(fmu, **options))
        return instances[-1]

    yield make
    for instance in instances:
        instance.free()
