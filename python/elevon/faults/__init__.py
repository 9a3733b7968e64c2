"""Faults as data: kind, place, severity in a physical unit, and a profile over time.

The catalogue itself comes from the core; the grammar is in ``docs/reference/faults.md``.
"""

from elevon.faults.catalogue import FaultRecord, catalogue, find_record
from elevon.faults.fault import Fault, check_together
from elevon.faults.profile import Profile, profile_records

__all__ = [
    "Fault",
    "FaultRecord",
    "Profile",
    "catalogue",
    "check_together",
    "find_record",
    "profile_records",
]
