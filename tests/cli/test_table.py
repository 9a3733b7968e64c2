"""Tables on a terminal: nothing is cut, whatever the width."""

import math
import os
import pty
import subprocess
import sys

import pytest

from elevon.cli.output import table_lines
from elevon.number_text import count_text, estimate_texts, interval_texts, severity_texts

HEADS = ["parameter", "before", "after", "low", "high", "unit", "register", "holds for"]
ROWS = [
    [
        "friction.static_over_dynamic_of_a_long_name",
        "7.7",
        "8.123",
        "-0.00015123",
        "8.1511",
        "kg cm2",
        "plant",
        "log-one.csv, log-two.csv",
    ],
    ["motor.inertia", "", "0.1", "0.05", "0.15", "N m", "controller", ""],
]


@pytest.mark.parametrize("width", [40, 60, 80, 100, 140, None])
def test_no_name_and_no_value_is_cut(width):
    lines = table_lines(HEADS, ROWS, width)
    text = "\n".join(lines)
    for row in ROWS:
        for cell in row:
            for word in cell.split():
                assert word in text
    assert "…" not in text
    longest = max(len(word) for row in ROWS for cell in row for word in cell.split())
    assert width is None or max(map(len, lines)) <= max(width, longest)


def test_one_line_a_row_where_there_is_room_and_for_a_pipe():
    assert len(table_lines(HEADS, ROWS, 200)) == 3
    assert table_lines(HEADS, ROWS, 200) == table_lines(HEADS, ROWS)


def test_optional_columns_are_left_out_first_and_named():
    lines = table_lines(HEADS, ROWS, 118, ["register", "holds for"])
    assert "register" not in lines[0]
    assert "holds for" in lines[0]
    assert lines[-1] == "not shown at this width: register"


def test_prose_is_wrapped_between_words_and_values_with_units_are_not():
    text = "the mean over the last second of the run at rest"
    lines = table_lines(["signal", "what it is", "value"], [["x", text, "7.7 kg cm2"]], 50)
    assert max(map(len, lines)) <= 50
    assert "7.7 kg cm2" in lines[1]
    assert " ".join(" ".join(line.split()) for line in lines[1:]).count("second") == 1


def test_a_broken_row_keeps_value_and_unit_together():
    rows = [["a" * 30, "-0.00015 kg cm2", "12345.678 N m s/rad"]]
    lines = table_lines(["name", "first", "second"], rows, 40)
    assert any("first: -0.00015 kg cm2" in line for line in lines)
    assert any("second: 12345.678 N m s/rad" in line for line in lines)


@pytest.mark.parametrize(
    ("numbers", "texts"),
    [
        ((0.123456, 0.11, 0.14), ("0.123", "0.110", "0.140")),
        ((123456.0, 120000.0, 127000.0), ("123500", "120000", "127000")),
        ((1.2345e-6, 1.2e-6, 1.26e-6), ("1.234e-06", "1.200e-06", "1.260e-06")),
        ((0.5, 0.5, 0.5), ("0.5", "0.5", "0.5")),
        ((-2.0, -3.0, 1.0), ("-2.0", "-3.0", "1.0")),
        ((-0.02, -3.0, 1.0), ("0.0", "-3.0", "1.0")),
        ((1.0, float("nan"), 2.0), ("1", "nan", "2")),
    ],
)
def test_a_value_has_the_digits_that_its_interval_supports(numbers, texts):
    assert interval_texts(*numbers) == texts


def test_an_estimate_is_displayed_in_the_unit_of_the_file():
    assert estimate_texts(7.7e-4, (7.6e-4, 7.8e-4), "kg m2") == ("7.70", "7.60", "7.80", "kg cm2")
    assert estimate_texts(0.03, (0.02, 0.04), "H", "mH") == ("30", "20", "40", "mH")


def test_a_severity_is_displayed_in_percent_and_degrees():
    assert severity_texts(0.123, (0.1, 0.15), "1") == ("12.3 %", "10.0 %", "15.0 %")
    assert severity_texts(math.radians(0.34), (math.radians(0.29), math.radians(0.41)), "rad") == (
        "0.34 deg", "0.29 deg", "0.41 deg")  # fmt: skip


@pytest.mark.parametrize("width", [80, 100])
@pytest.mark.parametrize("command", ["show torino-rotary", "list parameters torino-rotary"])
def test_commands_cut_nothing_on_a_terminal(command, width):
    """Every parameter and value of the actuator file stands whole on a real terminal of that
    width."""
    from elevon import Actuator

    text = _on_terminal(command.split(), width)
    assert "…" not in text
    for path in Actuator.load("torino-rotary").parameters:
        assert path in text
    long = [line for line in text.splitlines() if len(line) > width and " " in line[:width]]
    assert not [line for line in long if "parameter" in line]


def _on_terminal(arguments, width):
    main, side = pty.openpty()
    environment = dict(os.environ, COLUMNS=str(width), NO_COLOR="1")
    command = [sys.executable, "-m", "elevon.cli", *arguments]
    with subprocess.Popen(command, stdout=side, stdin=side, env=environment) as process:
        os.close(side)
        parts = []
        try:
            while part := os.read(main, 65536):
                parts.append(part)
        except OSError:  # the other end of a terminal is closed
            pass
        assert process.wait() == 0
    os.close(main)
    return b"".join(parts).decode().replace("\r\n", "\n")


def test_counts_are_written_without_powers_of_ten():
    texts = [count_text(x) for x in (0.0, 57.0, 1118.2, 9999.4, 353612.0, 3.2e12)]
    assert texts == ["0", "57", "1118", "9999", "353,600", "3.2e+12"]
