"""Tests of the toolkit; see docs/architecture.md for the rooms they mirror."""
