"""Which test to run next: the one with the largest expected information on what is ambiguous."""

from elevon.diagnose.nexttest.belief import Belief, Possible
from elevon.diagnose.nexttest.choose import Proposal, next_test
from elevon.diagnose.nexttest.profiles import Profile, profiles

__all__ = ["Belief", "Possible", "Profile", "Proposal", "next_test", "profiles"]
