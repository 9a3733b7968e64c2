"""Run-to-failure histories with mismatch, and how well their ends are predicted."""

from studies.prognosis.campaign import study_prognosis
from studies.prognosis.result import PrognosisResult

__all__ = ["PrognosisResult", "study_prognosis"]
