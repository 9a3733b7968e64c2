"""How an error is planted: functions of the package are replaced, runs of the core remembered."""

import pickle
from contextlib import contextmanager
from functools import cache
from importlib import import_module

import pytest

from elevon import _core

R = "elevon_cases."


@cache
def core_memory():
    """What the core has answered: the same runs are simulated once for all errors of a case."""
    return {}


@contextmanager
def patched(*places):
    """Replace functions named ``MODULE:NAME``, each by what its wrapper makes of it.

    Runs of the core are remembered, so that an error behind the simulation costs none.
    """
    with pytest.MonkeyPatch.context() as patch:
        remember(patch)
        for place, wrapper in places:
            module, _, name = place.partition(":")
            module = import_module(R + module if not module.startswith("elevon") else module)
            patch.setattr(module, name, wrapper(getattr(module, name)))
        yield


def remember(patch):
    """Let the core simulate equal runs once."""
    memory, simulate = core_memory(), _core.simulate

    def remembered(*arguments):
        key = pickle.dumps([item for item in arguments if not callable(item)])
        if key not in memory:
            memory[key] = simulate(*arguments)
        return memory[key]

    patch.setattr(_core, "simulate", remembered)


def scaled(factor, place=None):
    """Return a wrapper that scales what a function returns, or one of its arguments."""

    def wrapper(function):
        def wrong(*arguments, **options):
            if place is None:
                return factor * function(*arguments, **options)
            if isinstance(place, str):
                options[place] = factor * options[place]
            else:
                arguments = [*arguments[:place], factor * arguments[place], *arguments[place + 1 :]]
            return function(*arguments, **options)

        return wrong

    return wrapper


def given(change, place=0):
    """Return a wrapper that changes one argument of a function by another function."""

    def wrapper(function):
        def wrong(*arguments, **options):
            changed = list(arguments)
            changed[place] = change(changed[place])
            return function(*changed, **options)

        return wrong

    return wrapper


def work(name, **options):
    """Return the checks of a case as its command makes them."""
    from elevon_cases.cases import CASES

    case = next(case for case in CASES if case.name == name)
    chosen = case.defaults() | dict(case.published.options) | options
    return list(case.call(case.work, **chosen).checks)


def with_error(name, *places, **options):
    """Return the checks of a case whose work has an error."""
    with patched(*places):
        return work(name, **options)
