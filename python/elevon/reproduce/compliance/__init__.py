"""Stiffness of the Torino bench's transmission from its forty drops of a weight."""
