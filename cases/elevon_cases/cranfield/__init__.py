"""Cranfield's recordings of a linear actuator."""
