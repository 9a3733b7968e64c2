"""Features of a motion: computed while it is simulated, or from any log, by the same code."""

from elevon.features.log import LogFeatures, recording_features
from elevon.features.plan import FeaturePlan, feature_plans
from elevon.features.records import FeatureRecord, feature_records
from elevon.features.roles import ROLES, assign_roles, comparable

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
