"""Diagnosis of the Cranfield linear actuator from its recordings, without a model of it."""

from elevon.reproduce.cranfield.data import CONDITIONS, CranfieldData, read_folder
from elevon.reproduce.cranfield.result import CranfieldResult, reproduce_cranfield

__all__ = ["CONDITIONS", "CranfieldData", "CranfieldResult", "read_folder", "reproduce_cranfield"]
