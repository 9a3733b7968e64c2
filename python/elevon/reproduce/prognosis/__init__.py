"""Run-to-failure histories with mismatch, and how well their ends are predicted."""

from elevon.reproduce.prognosis.campaign import PrognosisResult, reproduce_prognosis

__all__ = ["PrognosisResult", "reproduce_prognosis"]
