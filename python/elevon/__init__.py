"""Elevon: simulate, break, test and calibrate electromechanical actuators.

The package imports nothing heavy by itself: every public name is looked up when it is first used.

>>> import elevon
>>> actuator = elevon.Actuator.load("torino-rotary")  # doctest: +SKIP
>>> elevon.diagnose("log.csv", actuator, baselines="healthy.csv")  # doctest: +SKIP
"""

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any


def _homes() -> dict[str, str]:
    """Return each public name with its module, as the stub beside this file states them."""
    lines = Path(__file__).with_suffix(".pyi").read_text("utf-8").splitlines()
    imports = [line.split() for line in lines if line.startswith("from ")]
    return {name: module for _, module, _, name, *_ in imports}


_PUBLIC = _homes()

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
