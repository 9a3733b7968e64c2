"""Which test to run next: the one with the largest expected information on what is ambiguous."""

from elevon.diagnose.nexttest.belief import Belief, Possible
from elevon.diagnose.nexttest.choose import NextTest, next_test
from elevon.diagnose.nexttest.profiles import BenchProfile, profiles

__all__ = ["Belief", "BenchProfile", "NextTest", "Possible", "next_test", "profiles"]
