"""Backlash of the Torino bench: measured, calculated, simulated and recovered."""
