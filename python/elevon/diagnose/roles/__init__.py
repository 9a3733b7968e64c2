"""Diagnosis of any actuator from the roles of its logs: features of the log against model runs."""

from elevon.diagnose.roles.diagnosis import diagnose_by_roles

__all__ = ["diagnose_by_roles"]
