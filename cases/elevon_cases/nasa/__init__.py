"""The test stand for ballscrew actuators: profiles, faults, temperatures, flights."""
