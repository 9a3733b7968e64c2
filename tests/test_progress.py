import pytest

from elevon.errors import InputError
from elevon.progress import part


def test_a_part_is_scaled_into_the_whole_and_passes_the_stop_on():
    seen = []
    second = part(lambda fraction: seen.append(fraction) or fraction < 0.6, 0.5, 1.0)
    assert [second(0.0), second(1.0)] == [True, False]
    assert seen == [0.5, 1.0]


def test_no_progress_stays_none():
    assert part(None, 0.0, 1.0) is None


def test_parts_outside_the_whole_are_refused():
    with pytest.raises(InputError):
        part(None, 0.5, 0.2)
