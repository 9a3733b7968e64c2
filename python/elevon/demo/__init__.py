"""The demonstration: a published table, then a bench with hidden values recovered from its logs.

Modules are imported by name; nothing is loaded here.
"""
