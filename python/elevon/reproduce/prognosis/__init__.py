"""Run-to-failure histories with mismatch, and how well their ends are predicted."""

from elevon.reproduce.prognosis.campaign import reproduce_prognosis
from elevon.reproduce.prognosis.result import PrognosisResult

__all__ = ["PrognosisResult", "reproduce_prognosis"]
