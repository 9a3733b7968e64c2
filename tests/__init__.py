"""Tests of the toolkit; see docs/explanation/architecture.md for the rooms they mirror."""
