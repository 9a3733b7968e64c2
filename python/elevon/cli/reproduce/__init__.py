"""`elevon reproduce`: recompute a published table or figure, with checks."""

from __future__ import annotations

import typer

from elevon.cli.groups import NamingGroup
from elevon.cli.reproduce.case import add_command
from elevon.cli.reproduce.cranfield import CASES as _CRANFIELD
from elevon.cli.reproduce.diagnosis import CASES as _DIAGNOSIS
from elevon.cli.reproduce.fault_limits import CASES as _FAULT_LIMITS
from elevon.cli.reproduce.nasa import CASES as _NASA
from elevon.cli.reproduce.next_test import CASES as _NEXT_TEST
from elevon.cli.reproduce.optimisers import CASES as _OPTIMISERS
from elevon.cli.reproduce.pisa import CASES as _PISA
from elevon.cli.reproduce.prognosis import CASES as _PROGNOSIS
from elevon.cli.reproduce.signatures import CASES as _SIGNATURES
from elevon.cli.reproduce.torino import CASES as _TORINO

app = typer.Typer(
    no_args_is_help=True,
    cls=NamingGroup,
    rich_markup_mode=None,
    help="Recompute a published table or figure; exit code 1 when a check fails.",
)


@app.callback()
def _group() -> None:
    """Recompute a published table or figure; exit code 1 when a check fails."""


_CASES = (
    *_TORINO,
    *_NASA,
    *_PISA,
    *_CRANFIELD,
    *_DIAGNOSIS,
    *_FAULT_LIMITS,
    *_NEXT_TEST,
    *_SIGNATURES,
    *_OPTIMISERS,
    *_PROGNOSIS,
)
for _case in _CASES:
    add_command(app, _case)
