"""What the tests of published cases share with those of the product."""

from tests.conftest import pytest_runtest_setup, quick_disk, shared

__all__ = ["pytest_runtest_setup", "quick_disk", "shared"]
