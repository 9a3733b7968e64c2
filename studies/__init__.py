"""What judges Elevon itself: its own diagnosis and prognosis on benches unlike its models.

Not in the wheel: run from a checkout, ``python -m studies NAME``. Published tables and figures are
`elevon reproduce`.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run a study and return its exit code, as `elevon.cli.main` does."""
    from elevon.cli import main as run

    return run(argv, module="studies.commands", program="python -m studies")
