"""Stiffness of the Torino bench's transmission from its forty drops of a weight."""

from elevon.reproduce.compliance.campaign import ComplianceResult, reproduce_compliance
from elevon.reproduce.compliance.fit import ComplianceFit, bootstrap_interval, fit_compliance

__all__ = [
    "ComplianceFit",
    "ComplianceResult",
    "bootstrap_interval",
    "fit_compliance",
    "reproduce_compliance",
]
