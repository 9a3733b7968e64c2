"""Live sessions: actuators that are stepped, read and changed while they run."""

from elevon.session.fmu import Fmu
from elevon.session.session import Controller, Session, run_loop
from elevon.session.values import SessionState

__all__ = ["Controller", "Fmu", "Session", "SessionState", "run_loop"]
