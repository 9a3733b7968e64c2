"""Features of a motion: computed while it is simulated, or from any log, by the same code."""

from elevon.features.plan import FeaturePlan, LogFeatures, feature_plans, recording_features
from elevon.features.records import ROLES, FeatureRecord, assign_roles, comparable, feature_records

__all__ = [
    "ROLES",
    "FeaturePlan",
    "FeatureRecord",
    "LogFeatures",
    "assign_roles",
    "comparable",
    "feature_plans",
    "feature_records",
    "recording_features",
]
