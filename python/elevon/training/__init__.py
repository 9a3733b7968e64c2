"""The surrogate of diagnosis from nothing: runs on the bench's tests, training, a test."""

from elevon.training.training import trained

__all__ = ["trained"]
