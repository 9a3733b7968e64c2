"""Clocks of a log: their quality, and two logs brought onto one time."""
