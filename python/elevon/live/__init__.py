"""The live bench: an actuator at real time in a page of the browser, moved, broken, watched."""
