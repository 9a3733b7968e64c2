"""Watching a unit while it runs: an alarm soon after a fault begins, few false ones."""

from elevon.diagnose.monitor.monitor import Alarm, Monitor, Monitoring, MonitorStep

__all__ = ["Alarm", "Monitor", "MonitorStep", "Monitoring"]
