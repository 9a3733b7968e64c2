"""What the shell offers when the tab key is pressed: actuators, parameters, faults, signals.

A mistake in what stands on the line so far offers nothing: completion never complains.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import suppress

import typer

from elevon.errors import ElevonError

_BREAKS = ("@", "=", ":")
"""Where bash cuts a word in two (its COMP_WORDBREAKS); zsh and fish hand over the whole word."""

Offer = Callable[[typer.Context, str], list[str]]


class _Offered(str):
    """The end of a candidate, which need not start with the whole word typed."""

    __slots__ = ()

    def startswith(self, *_: object) -> bool:
        return True


def _offers(candidates: Callable[[typer.Context, str], Iterator[str]]) -> Offer:
    """Turn a source of whole words into a completion, whatever the shell makes of the word."""

    def offer(ctx: typer.Context, incomplete: str) -> list[str]:
        before = len(_cut_off(incomplete))
        offered: list[str] = []
        with suppress(ElevonError, OSError):
            words = candidates(ctx, incomplete)
            offered += [word for word in words if word.startswith(incomplete)]
        return [_Offered(word[before:]) for word in offered]

    offer.__doc__ = candidates.__doc__  # not its signature: typer reads that of `offer`
    return offer


def _cut_off(typed: str) -> str:
    """Return the part of a word that bash keeps in front of what it lets be completed."""
    if "COMP_WORDS" not in os.environ:
        return ""
    return typed[: max(typed.rfind(mark) for mark in _BREAKS) + 1]


def join_words() -> None:
    """Put the words together that bash has cut at ``@``, ``=`` and ``:``, for who parses them."""
    words = os.environ.get("COMP_WORDS", "").split("\n")
    at = int(os.environ.get("COMP_CWORD", "0"))
    joined: list[str] = []
    cursor = 0
    for index, word in enumerate(words):
        glued = index > 1 and (word in _BREAKS or words[index - 1] in _BREAKS)
        if glued:
            joined[-1] += word
        else:
            joined.append(word)
        if index <= at:
            cursor = len(joined) - 1
    os.environ.update({"COMP_WORDS": "\n".join(joined), "COMP_CWORD": str(cursor)})


@_offers
def actuators(ctx: typer.Context, typed: str) -> Iterator[str]:  # noqa: ARG001
    """Offer the actuators that can be named; files are the shell's own offer."""
    from elevon.parameters import set_names

    yield from set_names()


@_offers
def fidelities(ctx: typer.Context, typed: str) -> Iterator[str]:  # noqa: ARG001
    """Offer the fidelities."""
    yield from ("high", "low")


@_offers
def procedures(ctx: typer.Context, typed: str) -> Iterator[str]:  # noqa: ARG001
    """Offer the virtual bench's procedures."""
    from elevon.bench.procedure import procedure_names

    yield from procedure_names()


@_offers
def parameters(ctx: typer.Context, typed: str) -> Iterator[str]:
    """Offer ``PATH=`` of the actuator on the line, then a choice's values."""
    from elevon.parameters import records

    known = records(_wiring(ctx))
    path, equals, _ = typed.partition("=")
    if not equals:
        yield from (f"{name}=" for name in known)
    elif path in known:
        yield from (f"{path}={choice}" for choice in known[path].choices or ())


@_offers
def faults(ctx: typer.Context, typed: str) -> Iterator[str]:
    """Offer ``KIND@`` of the actuator on the line, then ``KIND@PLACE=``."""
    from elevon.faults import catalogue

    known = catalogue(_wiring(ctx))
    kind, at, _ = typed.partition("@")
    if not at:
        yield from dict.fromkeys(f"{record.kind}@" for record in known)
    for record in known:
        if at and record.kind == kind:
            yield from (f"{kind}@{place}=" for place in record.places)


@_offers
def signals(ctx: typer.Context, typed: str) -> Iterator[str]:
    """Offer the signals of the actuator on the line, after the last comma."""
    from elevon import _core

    fidelity = ctx.params.get("fidelity") or "high"
    listed = typed.rpartition(",")[0]
    start = f"{listed}," if listed else ""
    for item in _core.signals(_wiring(ctx), fidelity):
        yield f"{start}{item['name']}"


def _wiring(ctx: typer.Context) -> str:
    """Return the wiring of the actuator on the line; before it stands there, the first one's."""
    from elevon.actuator import Actuator, list_actuators

    return Actuator.load(ctx.params.get("actuator") or list_actuators()[-1]).wiring
