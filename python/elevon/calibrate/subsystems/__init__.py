"""An actuator identified subsystem by subsystem, each from its measured input and output."""
