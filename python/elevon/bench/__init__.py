"""The test bench: what it writes, how its logs are read, and the parts it is made of.

Modules are imported by name (`from elevon.bench import command`); nothing is loaded here.
"""
