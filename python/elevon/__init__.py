"""Elevon: simulate, break, test and calibrate electromechanical actuators.

The package imports nothing heavy by itself: every public name is looked up when it is first used.

>>> import elevon
>>> actuator = elevon.Actuator.load("torino-rotary")  # doctest: +SKIP
>>> elevon.diagnose("log.csv", actuator, baselines="healthy.csv")  # doctest: +SKIP
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from elevon.actuator import Actuator as Actuator
    from elevon.actuator import list_actuators as list_actuators
    from elevon.calibrate.door import calibrate as calibrate
    from elevon.calibrate.door import validate as validate
    from elevon.campaign import load_campaign as load_campaign
    from elevon.deploy import export_fmu as export_fmu
    from elevon.diagnose.door import diagnose as diagnose
    from elevon.diagnose.door import monitor as monitor
    from elevon.diagnose.learning.door import learn as learn
    from elevon.diagnose.learning.door import learn_spread as learn_spread
    from elevon.doctor.door import doctor as doctor
    from elevon.doors import bench as bench
    from elevon.doors import compare as compare
    from elevon.doors import effects as effects
    from elevon.doors import response as response
    from elevon.errors import ElevonError as ElevonError
    from elevon.errors import ElevonWarning as ElevonWarning
    from elevon.errors import InputError as InputError
    from elevon.errors import NotActingWarning as NotActingWarning
    from elevon.logs.read import read_log as read_log
    from elevon.nexttest.door import next_test as next_test
    from elevon.prognose.door import fleet as fleet
    from elevon.prognose.door import next_inspection as next_inspection
    from elevon.prognose.door import predict as predict
    from elevon.recording import Channel as Channel
    from elevon.recording import Clock as Clock
    from elevon.recording import Recording as Recording
    from elevon.results import Result as Result
    from elevon.results import load as load
    from elevon.scenario import Scenario as Scenario
    from elevon.session import Fmu as Fmu
    from elevon.session import Session as Session
    from elevon.simulate import Run as Run
    from elevon.simulate import simulate as simulate
    from elevon.simulate import simulate_batch as simulate_batch

_PUBLIC = {
    "bench": "elevon.doors",
    "calibrate": "elevon.calibrate.door",
    "compare": "elevon.doors",
    "diagnose": "elevon.diagnose.door",
    "doctor": "elevon.doctor.door",
    "effects": "elevon.doors",
    "export_fmu": "elevon.deploy",
    "fleet": "elevon.prognose.door",
    "learn": "elevon.diagnose.learning.door",
    "learn_spread": "elevon.diagnose.learning.door",
    "monitor": "elevon.diagnose.door",
    "next_test": "elevon.nexttest.door",
    "next_inspection": "elevon.prognose.door",
    "predict": "elevon.prognose.door",
    "read_log": "elevon.logs.read",
    "response": "elevon.doors",
    "validate": "elevon.calibrate.door",
    "Actuator": "elevon.actuator",
    "Channel": "elevon.recording",
    "Clock": "elevon.recording",
    "ElevonError": "elevon.errors",
    "ElevonWarning": "elevon.errors",
    "Fmu": "elevon.session",
    "InputError": "elevon.errors",
    "NotActingWarning": "elevon.errors",
    "Recording": "elevon.recording",
    "Result": "elevon.results",
    "Run": "elevon.simulate",
    "Scenario": "elevon.scenario",
    "list_actuators": "elevon.actuator",
    "load": "elevon.results",
    "load_campaign": "elevon.campaign",
    "Session": "elevon.session",
    "simulate": "elevon.simulate",
    "simulate_batch": "elevon.simulate",
}

__all__ = [  # noqa: PLE0604 - the two names resolved without a module come first
    "__version__",
    *_PUBLIC,
]


class _Package(ModuleType):
    """The package's own module type.

    Importing `elevon.simulate` makes the import system bind the submodule to the name `simulate`
    of the package, hiding the function of that name. Public names always win here.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _PUBLIC and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value: Any = _version()
    elif name in _PUBLIC:
        value = getattr(import_module(_PUBLIC[name]), name)
    else:
        raise AttributeError(f"module 'elevon' has no attribute {name!r}")
    globals()[name] = value
    return value


def _announce_extras() -> None:
    """Let an import that fails for want of an extra say how to install it, in Python, too."""
    from elevon.extras import MissingExtras

    if not any(isinstance(finder, MissingExtras) for finder in sys.meta_path):
        sys.meta_path.append(MissingExtras())


_announce_extras()


def __dir__() -> list[str]:
    return sorted(__all__)


def _version() -> str:
    from elevon import _core

    return _core.version()
