"""Public logs of real machines: only the files that the figures were made of are taken."""

import hashlib
import math
from dataclasses import replace

import pytest

from elevon.cli import main
from elevon.errors import InputError
from elevon_cases.cases import CASES
from elevon_cases.real.machines import FOLDER, RealMachineResult, check_files, machines
from planted_real import real

NAMES = list(machines())


@pytest.mark.parametrize("name", NAMES)
def test_a_data_set_states_its_files_and_holds_some_out(name):
    machine = machines()[name]
    used = {log for fit in machine.fits for log in (*fit.logs, *fit.held_out)}
    assert used == set(machine.files)
    assert all(not set(fit.logs) & set(fit.held_out) for fit in machine.fits)
    assert any(fit.held_out for fit in machine.fits)
    assert all(len(digits) == 64 for digits in machine.files.values())
    for fit in machine.fits:
        assert (FOLDER / fit.map).is_file()
    assert f"real-{name}" in {case.name for case in CASES}


@pytest.mark.parametrize("name", NAMES)
def test_without_data_or_with_other_files_the_command_ends_with_2(name, tmp_path, capsys):
    assert main(["reproduce", f"real-{name}"]) == 2
    words = ["reproduce", f"real-{name}", "--data", str(tmp_path), "--json"]
    assert main(words) == 2
    first = next(iter(machines()[name].files))
    captured = capsys.readouterr()
    assert f"{first}: no such file" in captured.err
    assert machines()[name].source[:20] in captured.err
    (tmp_path / first).write_bytes(b"another")
    assert main(words) == 2
    captured = capsys.readouterr()
    assert "SHA-256" in captured.err
    assert captured.out == ""


def test_the_stated_file_is_taken(tmp_path):
    (tmp_path / "log.csv").write_bytes(b"samples")
    digits = hashlib.sha256(b"samples").hexdigest()
    machine = replace(machines()["emps"], files={"log.csv": digits})
    check_files(machine, tmp_path)
    with pytest.raises(InputError, match="stated is"):
        check_files(replace(machine, files={"log.csv": "0" * 64}), tmp_path)


def test_what_no_fit_determined_is_no_pass():
    checks = RealMachineResult([], [], {}, "", "", {}, machines()["emps"]).checks
    assert checks
    assert not any(check.passed for check in checks)
    assert all(math.isnan(check.value) for check in checks)


def test_a_number_below_the_authors_fails_as_one_above():
    assert not all(check.passed for check in real("hsm150", 0.7))


def test_files_do_not_agree_where_one_determines_nothing():
    checks = RealMachineResult([], [], {}, "", "", {}, machines()["dynamometer"]).checks
    (apart,) = (check for check in checks if check.name.endswith("intervals apart"))
    assert not apart.passed
