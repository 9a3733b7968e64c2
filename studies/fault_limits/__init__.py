"""Detection limit of each fault in each standard test of each actuator."""
