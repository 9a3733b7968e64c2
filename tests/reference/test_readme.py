"""Every command and example of README and of the guide runs as written."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import elevon

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    "README.md",
    "docs/evidence/reproduce.md",
    "docs/evidence/studies.md",
    "docs/how-to/sessions.md",
]
LONG = (
    "reproduce torino-backlash",
    "reproduce torino-compliance",
    "reproduce torino-fmeca",
    "reproduce torino-validation",
    "compare ",
    "--faults-table",
    "--loop ",
    "reproduce nasa-",
    "response nasa-ballscrew",
    "reproduce pisa-",
    "studies prognosis",
    "studies lives",
)
"""These take ten seconds and more; the short ones run with every `make test`, once."""


def _blocks(page, language):
    text = (ROOT / page).read_text("utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.M | re.S)


def _commands():
    for page in PAGES:
        for block in _blocks(page, "sh"):
            for line in block.splitlines():
                command, _, remark = (part.strip() for part in line.partition("#"))
                if command:
                    yield page, command, int(remark.startswith("exits with 1: "))


def _work(command):
    """What a command does, wherever it puts it."""
    return command.removeprefix(".venv/bin/").split(" --out ")[0].strip()


def _marks(page, command):
    earlier = [c for p, c, _ in COMMANDS if p == PAGES[0] and page != p]
    again = _work(command) in map(_work, earlier)
    return [pytest.mark.long] if again or any(k in command for k in LONG) else []


COMMANDS = sorted(set(_commands()))
ELEVON = [
    pytest.param(page, command, code, marks=_marks(page, command))
    for page, command, code in COMMANDS
    if ("elevon" in command or "studies" in command) and not command.startswith("pip ")
]


def test_there_are_commands_and_an_example():
    assert len(ELEVON) >= 6
    assert len(_blocks("README.md", "python")) == 2


@pytest.mark.parametrize(("page", "command", "code"), ELEVON)
def test_command(page, command, code, tmp_path):
    """It ends as its page says: well, or with 1 where a check of a published case fails."""
    words = shlex.split(command)
    module = "studies" if words[:3] == ["python", "-m", "studies"] else "elevon"
    assert module == "studies" or words[0] in (".venv/bin/elevon", "elevon")
    words = words[3:] if module == "studies" else words[1:]
    words = [str(ROOT / word) if word.startswith("examples/") else word for word in words]
    done = subprocess.run(
        [sys.executable, "-m", module, *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stderr
    assert done.stdout


@pytest.mark.parametrize("target", [c.split()[1] for _, c, _ in COMMANDS if c.startswith("make ")])
def test_make_targets_exist(target):
    makefile = (ROOT / "Makefile").read_text("utf-8")
    assert re.search(rf"^{target}:", makefile, re.M)


def test_demo_is_the_command_of_this_page():
    assert "elevon demo --out out/demo" in (ROOT / "Makefile").read_text("utf-8")


def test_example(tmp_path, monkeypatch, capsys):
    code, _ = _blocks("README.md", "python")
    assert len([line for line in code.splitlines() if line.strip()]) <= 10
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {})
    assert capsys.readouterr().out.startswith("ok ")
    assert (tmp_path / "run.parquet").is_file()


BENCHES = {
    "torino-rotary": ("chirp", "backlash@transmission=0.1 deg"),
    "nasa-ballscrew": ("ballscrew-profiles", "backlash@transmission=0.1 mm"),
    "pisa-landing-gear": ("gear-cycles", "proximity_off@sensor.proximity_25=1"),
    "examples/linear-drive/drive.toml": ("ballscrew-profiles", "backlash@transmission=0.1 mm"),
}


def test_a_worn_day_is_named_and_its_answer_read_back(tmp_path):
    """The cheap form of the ten lines: the rotary unit at low fidelity, its own values."""
    days = {"new": [], "worn": ["backlash@transmission=0.1 deg"]}
    logs = [
        elevon.bench("chirp", "torino-rotary", tmp_path / name, faults=faults, fidelity="low").paths
        for name, faults in days.items()
    ]
    answer = elevon.diagnose(logs[1], "torino-rotary", baselines=logs[0])
    assert answer.best == ("backlash@transmission",)
    assert elevon.load(answer.save(tmp_path / "answer.json")) == answer


#: What every result of the ten lines must bear, and the answers in one line.
_READ_BACK = """
for number, result in enumerate((fitted, *(answer for _, answer in history))):
    assert elevon.load(result.save(f"{number}.json")) == result
print(*(answer.status for _, answer in history), *history[-1][1].best)
"""


def _ten_lines(unit, folder):
    """Run the ten lines, with what the bench of a unit is called; return what they print."""
    _, code = _blocks("README.md", "python")
    assert len([line for line in code.splitlines() if line.strip()]) <= 10
    (procedure, fault), (chirp, _) = BENCHES[unit], BENCHES["torino-rotary"]
    for old, new in (("torino-rotary", unit), (f'"{chirp}"', f'"{procedure}"')):
        code = code.replace(old, new)
    if unit != "torino-rotary":  # wear and mission are the rotary unit's
        assert code.count('f"backlash@transmission={wear} deg"') == 1
        code = code.replace('f"backlash@transmission={wear} deg"', repr(fault))
        code = "\n".join(line for line in code.splitlines() if "elevon.predict" not in line)
    shutil.copytree(ROOT / "examples", folder / "examples")
    done = subprocess.run(
        [sys.executable, "-c", code + _READ_BACK],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def _numbers(line):
    return [float(text.replace(",", "")) for text in re.findall(r"\d[\d,]*\.?\d*", line)]


def test_the_answers_printed_in_readme_are_those_of_its_lines(tmp_path):
    """Words alike; what is estimated lies within the printed interval."""
    fault, life, statuses = _ten_lines("torino-rotary", tmp_path)
    printed = _blocks("README.md", "text")[1].splitlines()
    assert len(printed) == 2
    for line, expected in zip((fault, life), printed, strict=True):
        assert re.sub(r"[\d,.]+", "#", line) == re.sub(r"[\d,.]+", "#", expected)
    size, low, high, _ = _numbers(printed[0])
    assert low <= _numbers(fault)[0] <= high
    assert _numbers(fault)[0] == pytest.approx(size, abs=0.5 * (high - low))
    _, median, _, low, high, _ = _numbers(printed[1])
    assert low <= _numbers(life)[1] <= high
    assert _numbers(life)[1] == pytest.approx(median, rel=0.1)
    assert statuses.split() == ["faulty"] * 3 + ["backlash@transmission"]


@pytest.mark.long
@pytest.mark.parametrize("unit", list(BENCHES)[1:])
def test_from_logs_to_an_answer(unit, tmp_path):
    """The ten lines with what each other actuator's bench is called."""
    last = _ten_lines(unit, tmp_path)[-1].split()
    assert last[:3] == ["faulty"] * 3
    assert BENCHES[unit][1].partition("=")[0] in last[3:]


@pytest.mark.parametrize(
    "page",
    [
        "docs/how-to/sessions.md",
        "docs/reference/scenarios.md",
        "docs/reference/recordings.md",
        "docs/how-to/own-actuators.md",
        "docs/how-to/python.md",
    ],
)
def test_examples_of_a_page(page, tmp_path, monkeypatch, capsys):
    """The Python of a page, block by block, in one process: as a reader would paste it."""
    blocks = _blocks(page, "python")
    assert blocks
    monkeypatch.chdir(tmp_path)
    exec(compile("\n".join(blocks), page, "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out


@pytest.mark.long
@pytest.mark.parametrize(
    "page",
    ["docs/how-to/own-actuators.md", "docs/start/tutorial.md"],
)
def test_commands_of_a_page_in_their_order(page, tmp_path):
    """The commands of a page build on each other: all of them run in one folder, as written."""
    for block in _blocks(page, "sh"):
        for line in filter(None, map(str.strip, block.splitlines())):
            words = shlex.split(line)
            assert words[0] == "elevon"
            done = subprocess.run(
                [sys.executable, "-m", "elevon", *words[1:]],
                cwd=tmp_path,
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, f"{line}\n{done.stderr}"
            variant = tmp_path / "mine.toml"
            if words[1:3] == ["new", "mine"] and page == "docs/how-to/own-actuators.md":
                variant.write_text(_blocks(page, "toml")[0], "utf-8")


def test_scenarios_page_holds_a_scenario(tmp_path):
    (tmp_path / "a.toml").write_text(_blocks("docs/reference/scenarios.md", "toml")[0], "utf-8")
    scenario = elevon.Scenario.load(tmp_path / "a.toml")
    run = elevon.simulate(
        "torino-rotary", scenario, fidelity="low", record="output_position@100 Hz"
    )
    assert run.status == "ok"
    assert run["output_position"].to("deg")[0] == pytest.approx(2.0)


@pytest.mark.parametrize(
    "page",
    ["README.md", *(str(path.relative_to(ROOT)) for path in sorted((ROOT / "docs").rglob("*.md")))],
)
def test_links_and_pictures_are_there(page):
    text = (ROOT / page).read_text("utf-8")
    for target in re.findall(r"\]\((?!https?://)([^)#]+)\)", text):
        path = (ROOT / page).parent / target
        assert path.is_file(), target
        assert path.suffix not in (".svg", ".png") or path.stat().st_size < 200_000
