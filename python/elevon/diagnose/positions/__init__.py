"""Logs with both positions of a servo: read, checked, their features by regression."""
