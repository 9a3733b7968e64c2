"""Watching a unit while it runs: an alarm soon after a fault begins, few false ones."""

from elevon.diagnose.monitor.answer import Alarm, Monitoring, MonitorStep
from elevon.diagnose.monitor.cutter import SampleCounts
from elevon.diagnose.monitor.monitor import Monitor

__all__ = ["Alarm", "Monitor", "MonitorStep", "Monitoring", "SampleCounts"]
