"""Measured logs: their formats, their columns, their clocks and the command that drove them.

Modules are imported by name (`from elevon.logs.importing import import_log`).
"""
