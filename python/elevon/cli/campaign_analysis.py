"""``elevon campaign effects`` and ``elevon campaign surrogate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from elevon.cli.output import answer, print_table, progress_bar
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.analysis.effects import Effects


def add_to(app: typer.Typer) -> None:
    """Add the commands to ``elevon campaign``."""
    command(app, "report", "force")(effects)
    command(app)(surrogate)


def effects(
    folder: Path,
    *,
    response: str,
    level: float = 0.95,
) -> Answer:
    """Say which factors move a response, and by how much: main effects and interactions."""
    from elevon.doors import effects as run

    effects = run(folder, response, level=level)
    return Answer(effects, lambda: _print_effects(effects), page=effects.report)


def _print_effects(effects: Effects) -> None:
    from elevon.analysis.effects import EQUAL_REPEATS

    rows = [
        [t.term, t.name, f"{t.effect:.4g}", _interval(t), ", ".join(t.aliases)]
        for t in effects.terms
    ]
    answer(effects.headline, f"by {effects.method}")
    print_table(("term", "factors", "effect", "interval", "aliased with"), rows)
    for text, names in (
        ("confounded with the blocks", effects.blocked),
        ("left out, partly aliased", effects.partial),
    ):
        if names:
            typer.echo(f"{text}: {', '.join(names)}")
    if effects.equal_repeats:
        typer.echo(EQUAL_REPEATS)


def _interval(term: Any) -> str:
    if term.low is None:
        return "not known"
    return f"{term.low:.4g} to {term.high:.4g}{' *' if term.significant else ''}"


def surrogate(
    folder: Path,
    *,
    response: str,
    low: Path | None = None,
    cost_ratio: float | None = None,
    budget: int | None = None,
    splits: int = 10,
    seed: int = 0,
) -> Answer:
    """Fit a surrogate of a response, and say how well it predicts runs it has not seen.

    With --low: kriging of the high runs against co-kriging of both fidelities at equal cost.
    """
    from elevon.analysis.response import pair, read_response, samples_of
    from elevon.analysis.surrogate import study
    from elevon.campaign import load_campaign

    high = load_campaign(folder)
    measured = read_response(high, response)
    pairs = ratio = None
    if low is not None:
        below = load_campaign(low)
        pairs = pair(high, below, response)
        ratio = cost_ratio or _cost_ratio(high, below)
    with progress_bar("fitting surrogates") as advance:
        result = study(
            samples_of(measured) if pairs is None else pairs.high,
            pairs,
            response=response,
            unit=measured.unit,
            cost_ratio=ratio or 1.0,
            budget=budget,
            splits=splits,
            seed=seed,
            progress=advance,
        )
    return Answer(result, lambda: _print_surrogate(result))


def _print_surrogate(result: Any) -> None:
    rows = [
        [v.name, v.high, v.low, f"{v.mean:.3g}", f"{v.interval[0]:.3g} to {v.interval[1]:.3g}"]
        for v in result.variants
    ]
    answer(result.headline)
    title = f"{result.response}: error on held-out high runs over the response's standard deviation"
    print_table(("surrogate", "high runs", "low runs", "error", "interval"), rows, title=title)
    if result.gain is not None and result.gain_interval is not None:
        first, last = result.gain_interval
        typer.echo(
            f"kriging less co-kriging at equal cost (a high run costs {result.cost_ratio:.3g} low "
            f"ones): {result.gain:.3g}, interval {first:.3g} to {last:.3g}"
        )


def _cost_ratio(high: Any, low: Any) -> float:
    """Return what a high run costs over a low one, as the campaigns were estimated."""
    cost = [ds.manifest.estimate["seconds"] / len(ds) for ds in (high, low)]
    return max(float(cost[0] / cost[1]), 1.0)
