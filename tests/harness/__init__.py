"""Kills, full disks and second processes at every command that writes; see `test_writes.py`."""
