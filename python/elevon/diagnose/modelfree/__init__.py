"""Diagnosis without a model of the actuator: features, a healthy baseline, a classifier."""

from elevon.diagnose.modelfree.baseline import HealthyBaseline
from elevon.diagnose.modelfree.discriminant import Discriminant
from elevon.diagnose.modelfree.features import FULL, TRANSFER, FeatureTable, feature_table
from elevon.diagnose.modelfree.model import ModelFree
from elevon.diagnose.modelfree.strokes import StrokeSpan, find_strokes

__all__ = [
    "FULL",
    "TRANSFER",
    "Discriminant",
    "FeatureTable",
    "HealthyBaseline",
    "ModelFree",
    "StrokeSpan",
    "feature_table",
    "find_strokes",
]
