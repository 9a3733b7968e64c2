"""Ctrl-C at any moment: exit 130, one line on stderr that says what is kept, nothing on stdout."""

import os
import signal
import subprocess
import sys
import time
import weakref

import pytest

from elevon.bench.traces import finished_logs
from elevon.cli import interrupt, main
from elevon.errors import OutputExistsError
from elevon.files import journal, write_text
from tests.patches import put

TRACE = (
    '[[step]]\nkind = "trace"\nname = "{}"\nduration = "{}"\n'
    '[step.command]\nterms = [{{ kind = "sine", amplitude = "7 deg", frequency = "0.5 Hz" }}]\n'
)


@pytest.fixture(autouse=True)
def own_handler():
    """Whatever runs the tests, here Ctrl-C is Python's own, and is again after the command."""
    earlier = signal.signal(signal.SIGINT, signal.default_int_handler)
    hook = sys.unraisablehook
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert sys.unraisablehook is hook
    signal.signal(signal.SIGINT, earlier)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("log")
    (folder / "p.toml").write_text('name = "p"\n' + TRACE.format("sine", "3 s"))
    run = ["bench", "run", str(folder / "p.toml"), "--actuator", "torino-rotary", "--out"]
    assert main([*run, str(folder), "--fidelity", "low"]) == 0
    return folder / "sine.csv"


def press(*_arguments, **_options):
    """Press Ctrl-C."""
    signal.raise_signal(signal.SIGINT)


HALF = {
    "design": ("elevon.bench.spring.design_spring", ["design", "spring", "--json"]),
    "import": (
        "elevon.logs.read.imported_log",
        ["import", "LOG", "--out", "OUT/r.parquet", "--json"],
    ),
    "saving": (
        "elevon.recording.Recording.save",
        ["import", "LOG", "--out", "OUT/r.parquet", "--json"],
    ),
    "bench run": (
        "elevon.bench.run.recorded",
        ["bench", "run", "chirp", "--actuator", "torino-rotary", "--out", "OUT/logs", "--json"],
    ),
    "calibrate": (
        "elevon.calibrate.calibration.calibrate",
        ["calibrate", "LOG", "--actuator", "torino-rotary", "--out", "OUT/set.toml", "--json"],
    ),
    "validate": (
        "elevon.calibrate.door.validate_drive",
        ["validate", "LOG", "--actuator", "torino-rotary", "--report", "OUT/r.html", "--json"],
    ),
    "report": (
        "elevon.report.figures.inline_svg",
        ["validate", "LOG", "--actuator", "torino-rotary", "--report", "OUT/r.html", "--json"],
    ),
    "demo": (
        "elevon.demo.run.live",
        ["demo", "--out", "OUT/demo", "--json"],
    ),
    "campaign": (
        "elevon.campaign.execute.simulate_block",
        ["campaign", "run", "PLAN", "--out", "OUT/b"],
    ),
}


@pytest.mark.parametrize("name", HALF)
def test_every_command_says_that_it_was_interrupted(name, log, tmp_path, capsys, monkeypatch):
    inner, command = HALF[name]
    plan = tmp_path / "plan.toml"
    plan.write_text(
        'actuator = "torino-rotary"\nseeds = [1]\n[scenario]\nduration = "10 ms"\n'
        '[[scenario.command.terms]]\nkind = "constant"\nvalue = "1 deg"\n'
    )
    put(monkeypatch, inner, press)
    places = {"LOG": str(log), "OUT": str(tmp_path / "out"), "PLAN": str(plan)}
    for word, place in places.items():
        command = [part.replace(word, place) for part in command]
    assert main(command) == 130
    captured = capsys.readouterr()
    assert captured.out == ""
    last = captured.err.splitlines()[-1]
    assert last.startswith("elevon: interrupted; ")
    assert "again" in last
    assert "Traceback" not in captured.err
    left = [path.name for path in tmp_path.rglob("*") if path.is_file()]
    results = [file for file in left if file.endswith((".parquet", ".html", ".csv"))]
    assert set(results) <= {"runs.parquet"}  # a campaign's table of what is planned
    assert not [file for file in left if ".part" in file]


def test_what_was_written_before_is_named(log, tmp_path, capsys, monkeypatch):
    from elevon.recording import Recording

    save = Recording.save

    def second(recording, path, **options):
        if "two" in str(path):
            press()
        return save(recording, path, **options)

    other = tmp_path / "two.csv"
    other.write_bytes(log.read_bytes())
    monkeypatch.setattr(Recording, "save", second)
    assert main(["import", str(log), str(other), "--out", str(tmp_path / "r"), "--json"]) == 130
    captured = capsys.readouterr()
    assert captured.out == ""
    assert f"kept, each whole: {tmp_path / 'r' / 'sine.parquet'}; " in captured.err
    assert "--force" in captured.err
    assert [path.name for path in (tmp_path / "r").iterdir()] == ["sine.parquet"]


def test_before_the_command_has_begun(capsys, monkeypatch):
    monkeypatch.setattr("elevon.cli.runner.run", press)
    assert main(["list"]) == 130
    assert "interrupted; nothing was written" in capsys.readouterr().err


def test_an_error_that_ctrl_c_became_in_a_library(capsys, monkeypatch):
    def broken(*_arguments, **_options):
        try:
            press()
        except KeyboardInterrupt:
            raise SystemError("initialization raised unreported exception") from None

    put(monkeypatch, "elevon.bench.spring.design_spring", broken)
    assert main(["design", "spring"]) == 130
    assert "interrupted" in capsys.readouterr().err


def test_an_error_without_ctrl_c_stays_one(monkeypatch):
    def broken(*_arguments, **_options):
        raise SystemError("ours")

    put(monkeypatch, "elevon.bench.spring.design_spring", broken)
    with pytest.raises(SystemError, match="ours"):
        main(["design", "spring"])


class _Thing:
    pass


def _lose():
    """Press Ctrl-C where Python cannot raise: in the callback of a weak reference."""
    thing = _Thing()
    watched = weakref.ref(thing, press)
    del thing
    return watched


def test_a_lost_ctrl_c_comes_again(capsys, monkeypatch):
    def long_work(*_arguments, **_options):
        _lose()
        for _ in range(400):
            time.sleep(0.01)
        raise AssertionError("the work went on")

    put(monkeypatch, "elevon.bench.spring.design_spring", long_work)
    assert main(["design", "spring"]) == 130
    captured = capsys.readouterr()
    assert "interrupted" in captured.err
    assert "Exception ignored" not in captured.err


def test_progress_notices_a_lost_ctrl_c():
    from elevon.cli.output import progress_bar

    with interrupt.watched(owner=False), progress_bar("work") as advance:
        assert advance(0.1)
        with pytest.raises(KeyboardInterrupt):
            press()
        with pytest.raises(KeyboardInterrupt):
            advance(0.2)


def test_no_second_ctrl_c_cuts_the_message(capsys, monkeypatch, tmp_path):
    def describe(*_arguments, **_options):
        press()
        return "all of it"

    monkeypatch.setattr("elevon.cli.bench._story", describe)
    put(monkeypatch, "elevon.bench.run.recorded", press)
    run = ["bench", "run", "chirp", "--actuator", "torino-rotary", "--out", str(tmp_path / "o")]
    assert main(run) == 130
    assert capsys.readouterr().err.endswith("elevon: interrupted; all of it\n")


def test_the_journal_holds_what_has_its_name(tmp_path):
    with journal() as outer:
        write_text(tmp_path / "a", "a")
        with journal() as inner:
            write_text(tmp_path / "b", "b")
        with pytest.raises(OutputExistsError):
            write_text(tmp_path / "b", "again")
    assert [path.name for path in outer] == ["a"]
    assert [path.name for path in inner] == ["b"]


def start(*arguments, cwd):
    command = [sys.executable, "-m", "elevon.cli", *map(str, arguments)]
    return subprocess.Popen(
        command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip


def until(condition, process):
    for _ in range(2000):
        if condition() or process.poll() is not None:
            return
        time.sleep(0.01)


def test_a_process_group_stopped_in_the_core_goes_on_later(tmp_path):
    """The signal of a terminal, while the core computes the second of two logs."""
    text = 'name = "p"\n' + TRACE.format("one", "1 s") + TRACE.format("two", "400 s")
    (tmp_path / "p.toml").write_text(text)
    run = ("bench", "run", "p.toml", "--actuator", "torino-rotary", "--out", "logs", "--json")
    process = start(*run, cwd=tmp_path)
    state = tmp_path / "logs" / "bench-p.log"
    until(lambda: state.is_file() and '"one"' in state.read_text(), process)
    time.sleep(0.2)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=20)
    assert (process.returncode, out) == (130, ""), err
    assert "interrupted; 1 of 2 logs are kept in logs" in err.splitlines()[-1]
    assert finished_logs(state) == ["one"]
    assert not (tmp_path / "logs" / "two.csv").exists()


def test_the_exit_code_is_the_same_where_the_exception_passed_through_exec(tmp_path):
    """Python started with -m remembers such an exception and would end by the signal."""
    (tmp_path / "design.py").write_text(
        "import signal, sys; from elevon.bench import spring\n"
        "from elevon.cli import main\n"
        "def design(*a, **k): exec('signal.raise_signal(signal.SIGINT)', globals())\n"
        "spring.design_spring = design\n"
        "sys.argv = ['elevon', 'design', 'spring', '--json']\n"
        "sys.exit(main())\n"
    )
    command = [sys.executable, "-m", "design"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr.startswith("elevon: interrupted; nothing was written")


def test_an_answer_that_nobody_reads_is_dropped_whole_on_ctrl_c(tmp_path):
    """The reader of a pipe has stopped reading; the command must still end, with its message."""
    process = start("design", "spring", "--json", cwd=tmp_path)
    assert os.read(process.stdout.fileno(), 1) == b"{"
    time.sleep(0.2)
    assert process.poll() is None, "the answer no longer fills the pipe"
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=10) == 130
    assert "interrupted" in process.stderr.read()
    process.stdout.close()
    process.stderr.close()
