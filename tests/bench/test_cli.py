"""`elevon design spring`: exit codes and JSON."""

import json

import pytest

from elevon.cli import main


def run(capsys, *arguments):
    code = main([str(a) for a in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_design_spring(capsys):
    code, out, _ = run(capsys, "design", "spring", "--json")
    assert code == 0
    result = json.loads(out)
    assert result["status"] == "pass"
    assert result["design"]["coils"] == 342
    assert result["design"]["rotation_rad"] == pytest.approx(16.25)
    assert all(check["passed"] for check in result["checks"])
    code, out, _ = run(capsys, "design", "spring", "--coil", "70 mm", "--json")
    assert code == 1
    failed = [c for c in json.loads(out)["checks"] if not c["passed"]]
    assert {c["name"] for c in failed} >= {"shear stress", "coil diameter"}
    code, out, err = run(capsys, "design", "spring", "--force", "60 N", "--json")
    assert (code, out) == (2, "")
    assert "75 N" in err
    code, out, _ = run(capsys, "design", "spring", "--wire", "3.2 mm", "--coil", "3.6 cm")
    assert code == 0
    assert "feasible" in out
