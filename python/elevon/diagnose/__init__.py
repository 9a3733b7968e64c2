"""What is wrong with an actuator, where, how bad, and how sure that is.

Modules are imported by name (`from elevon.diagnose.by_model import diagnose`).
"""
