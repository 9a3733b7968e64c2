"""Diagnosis by an accelerometer: spalls of a ball screw by the passes of its balls."""
