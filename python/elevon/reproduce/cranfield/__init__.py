"""Diagnosis of the Cranfield linear actuator from its recordings, without a model of it."""
