"""Lives whose growth is no law's, predicted."""

from studies.foreign.campaign import study_foreign
from studies.foreign.result import ForeignResult

__all__ = ["ForeignResult", "study_foreign"]
