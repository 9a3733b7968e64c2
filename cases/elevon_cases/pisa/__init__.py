"""The landing gear of the Pisa thesis: functional tests, friction, failures, monitoring."""
