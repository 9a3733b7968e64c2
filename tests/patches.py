"""What a test puts in the place of a function, by its module: a door may have a package's name."""

from pkgutil import resolve_name


def put(monkeypatch, place, value):
    """Put a value at ``package.module.name`` for the rest of a test."""
    module, _, name = place.rpartition(".")
    monkeypatch.setattr(resolve_name(module), name, value)
