"""Which test to run next: the one with the largest expected information on what is ambiguous."""

from elevon.nexttest.belief import Belief, Possible
from elevon.nexttest.door import NextTest, next_test
from elevon.nexttest.information import BenchProfile, profiles

__all__ = ["Belief", "BenchProfile", "NextTest", "Possible", "next_test", "profiles"]
