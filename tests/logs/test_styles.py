"""Every style of file gets in: without a map, with one question at most, and with its numbers."""

from pathlib import Path

import numpy as np
import pytest

from elevon.logs.formats.detect import read_table
from elevon.logs.maps.guess import guess_map
from elevon.logs.read import import_foreign, read_log
from tests.logs.styles import STYLES, servo, values_of, write

#: Of those that state no units more is asked: what a number is cannot be known.
WITHOUT_UNITS = {"robot-benchmark", "own-roles-no-units"}
PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "logs.md"


@pytest.fixture(scope="module")
def signals():
    return servo()


def questions(file):
    read = import_foreign(file)
    return [] if read.guess is None else list(read.guess.questions)


@pytest.mark.parametrize("name", STYLES)
def test_a_style_gets_in_with_its_numbers(name, tmp_path, signals):
    style = STYLES[name]
    file = write(tmp_path, style, signals)
    assert len(questions(file)) <= (2 if name in WITHOUT_UNITS else 1)
    log = read_log(file, drive=style.drive, roles=style.answers)
    np.testing.assert_allclose(log.time, signals["time"] - signals["time"][0], atol=1e-5)
    expected = {s: h for h, s, _ in style.columns if s and s not in {"time", "mode"}}
    assert expected.keys() <= set(log.channels)
    factors = {s: f for _, s, f in style.columns}
    given = values_of(style, signals)
    for role, header in expected.items():
        true = given[header] / factors[role]
        np.testing.assert_allclose(log[role], true, atol=2e-5 * max(1.0, np.abs(true).max()))


def test_of_the_styles_that_state_units_a_tenth_at_most_ask(tmp_path, signals):
    asking = []
    for name in STYLES.keys() - WITHOUT_UNITS:
        (tmp_path / name).mkdir()
        if questions(write(tmp_path / name, STYLES[name], signals)):
            asking.append(name)
    assert len(STYLES) >= 30
    assert len(asking) <= 0.1 * len(STYLES), asking


def test_the_page_lists_every_style():
    text = PAGE.read_text("utf-8")
    for name in STYLES:
        assert f"| {name} |" in text, name


def test_a_guess_takes_little_processor_time(tmp_path, signals):
    """20 s at 1 kHz: a fifth of it here; asked are 2 s of processor time for all."""
    import time

    file = write(tmp_path, STYLES["english-brackets"], signals)
    table = read_table(file)
    begin = time.process_time()
    guess_map(table)
    assert time.process_time() - begin < 1.0
