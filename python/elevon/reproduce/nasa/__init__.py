"""Nominal behaviour and faults of the NASA test stand's ballscrew actuator."""
