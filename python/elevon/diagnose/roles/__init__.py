"""Logs of any actuator: read by the roles of their channels, as numbers."""
