"""Diagnosis by trained trees: features of a log to faults, in milliseconds."""

from elevon.diagnose.surrogate.answer import diagnose_by_both, diagnose_by_surrogate
from elevon.diagnose.surrogate.model import Surrogate, shipped

__all__ = ["Surrogate", "diagnose_by_both", "diagnose_by_surrogate", "shipped"]
