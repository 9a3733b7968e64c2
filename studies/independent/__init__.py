"""Diagnosis judged on logs of a program that shares nothing with the package."""

from studies.independent.campaign import Plan, study_independent
from studies.independent.result import IndependentResult

__all__ = ["IndependentResult", "Plan", "study_independent"]
