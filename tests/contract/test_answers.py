"""Every command answers on stdout: never empty, its first line the answer, tables after it."""

import re

import pytest

from elevon.cli import main
from tests.harness.recipes import DESIGN, FLIGHT, FLY, LABELS, LOG, PLAN, SCENARIO
from tests.harness.registry import commands, shared_writer

pytestmark = pytest.mark.filterwarnings("ignore")
ROTARY = ("--actuator", "torino-rotary")
SET = ("campaign", "run", "plan.toml", "--out", "set")
EFFECTS = ("campaign", "run", "design.toml", "--out", "design")
BENCH = ("bench", "run", "log.toml", *ROTARY, "--fidelity", "low", "--out")
LOGS = ((*BENCH, "log"), (*BENCH, "base", "--seed", "3"))
SIX = tuple(
    (*BENCH, name, "--seed", str(k),
     *(("--fault", "backlash@transmission=0.2 deg") if name in "bdf" else ()))
    for k, name in enumerate("abcdef")
)  # fmt: skip
WATCH = ("bench", "run", "watch.toml", *ROTARY, "--fidelity", "low", "--out", "watch")
#: Command to its words, what its first line says, commands before it, whether it takes seconds.
ANSWERS = {
    "list actuators": ((), r"^name\b", (), False),
    "list parameters": (("torino-rotary",), r"^(name|path|parameter)", (), False),
    "list faults": (("torino-rotary",), r"^(name|fault|kind)", (), False),
    "list signals": (("torino-rotary",), r"^(name|signal)", (), False),
    "list waveforms": ((), r"^kind\b", (), False),
    "list laws": (("torino-rotary",), r"^law", (), False),
    "list features": ((), r"^(name|feature)", (), False),
    "show": (("torino-rotary",), r"^torino-rotary: ", (), False),
    "new": (("mine.toml", "--from", "torino-rotary"), r"^wrote mine\.toml", (), False),
    "check": (("s.toml",), r"^s\.toml: 0 errors, 0 warnings$", (), False),
    "simulate": (("torino-rotary", "--duration", "0.1", "--fidelity", "low"),
                 r"^torino-rotary, low fidelity: ok$", (), False),
    "campaign plan": (("plan.toml",), r"6 runs", (), False),
    "campaign run": (("plan.toml", "--out", "new"), r"^6 runs: 6 ok$", (), False),
    "campaign resume": (("set",), r"^6 runs \(6 done before\)", (SET,), False),
    "campaign status": (("set",), r"^campaign: ok, 6 of 6 runs done, 0 failed$", (SET,), False),
    "campaign effects": (("design", "--response", "friction_current"),
                         r"friction_current .*move it", (EFFECTS,), False),
    "dataset describe": (("set",), r"^campaign: torino-rotary, low fidelity$", (SET,), False),
    "dataset verify": (("set",), r"^set: whole$", (SET,), False),
    "dataset export": (("set", "--out", "copy", "--runs", "0"), r"^\d+ files in copy$", (SET,),
                       False),
    "dataset split": (("set", "--share", "train=0.5", "--share", "test=0.5"),
                      r"^\d train, \d test$", (SET,), False),
    "dataset repair": (("set",), r"^nothing is damaged$", (SET,), False),
    "compare": (("torino-rotary", "--scenario", "s.toml", "--after", "0.5"),
                r"% of the amplitude from the switching one", (), True),
    "response": (("torino-rotary", "--from", "2 Hz", "--to", "8 Hz", "--fidelity", "low"),
                 r"output_position of torino-rotary: gain -3 dB", (), True),
    "safety": (("pisa-landing-gear", "--every", "8000"), r"^(PASS|FAIL): \d+ of \d+ situations",
               (), True),
    "fit-low": (("torino-rotary", "--scenario", "fit.toml"), r"^\d+ numbers fitted", (), True),
    "list procedures": ((), r"^(name|procedure)", (), False),
    "bench list": ((), r"^(name|procedure)", (), False),
    "bench run": (("log.toml", *ROTARY, "--fidelity", "low", "--out", "other"),
                  r"^log: 1 of 1 logs made", (), False),
    "bench fly": (("fly.toml", "--actuator", "nasa-ballscrew", "--fidelity", "low", "--out",
                   "flown", "--switch", "0.5 s"), r"^2 logs, 4 files in flown$", (), False),
    "design spring": ((), r"^The spring (holds|does not hold)", (), False),
    "loads": (("flight.csv", "--area", "0.5 m2", "--chord", "400 mm", "--c-delta", "-0.4",
               "--actuator", "nasa-ballscrew", "--arm", "100 mm", "--out", "load.toml"),
              r"^load .* N over 2 s$", (), False),
    "export fmu": (("torino-rotary", "-o", "a.fmu", "--fidelity", "low"),
                   r"^wrote a\.fmu: FMI 3\.0, low fidelity, \d+ inputs, \d+ outputs", (), False),
    "export run": (("torino-rotary", "-o", "a.json"), r"^wrote a\.json: high fidelity", (), False),
    "import": (("log/log.csv", "--out", "rec.parquet"), r"-> rec\.parquet$", LOGS, False),
    "features": (("log/log.csv", "--features", "friction"), r"^log/log\.csv: \d+ features at",
                 LOGS, False),
    "calibrate": (("log/log.csv", *ROTARY), r"determined .*backlash\.total", LOGS, True),
    "validate": (("log/log.csv", *ROTARY, "--transient", "1"),
                 r"^torino-rotary: (not )?(passed|measured)",
                 LOGS, False),
    "plot": (("log/log.csv",), r"^wrote log\.html: \d+ signals of log\.csv$", LOGS, False),
    "doctor": (("log/log.csv", *ROTARY, "--baseline", "base/log.csv"),
               r"^(HEALTHY \(p = |FAULTY: |UNKNOWN FAULT: |MODEL DOES NOT FIT: ).*data: ", LOGS,
               True),
    "diagnose": (("log/log.csv", *ROTARY, "--baseline", "base/log.csv"),
                 r"^(HEALTHY \(p = |FAULTY: |UNKNOWN FAULT: |MODEL DOES NOT FIT: )", LOGS, True),
    "monitor": (("watch/log.csv", *ROTARY, "--baseline", "watch/log.csv", "--window", "2 s"),
                r"^(No alarm|Alarm at)", (WATCH,), True),
    "next-test": (ROTARY, r"bit", (), True),
    "predict": (("history", *ROTARY, "--mission", "mission.toml", "--particles", "500"),
                r"(remain|No end of life)", (), True),
    "next-inspection": (("history", *ROTARY, "--mission", "mission.toml", "--particles", "500"),
                        r"(Inspect (now|within)|No end of life)", (), True),
    "learn-growth": (("history", *ROTARY, "--mission", "mission.toml", "--censored", "lives.csv",
                      "--out", "growth.json"),
                     r"^\d+ units, \d+ failed; .* -> growth\.json$", (), True),
    "fleet": (("history", *ROTARY, "--mission", "mission.toml"), r"visit\(s\) for 1 units", (),
              True),
    "learn": ((*(f"{name}/log.csv" for name in "abcdef"), "--labels", "labels.csv",
               "--out", "model.npz"), r"^learnt: classes of 6 logs -> model\.npz$",
              SIX, True),
    "live": (("--fidelity", "low", "--static", "page"),
             r"^page/index\.html: a session of the live bench$", (), True),
    "demo": (("--out", "demo"), r"^At flight .* flights remain", (), True),
    "reproduce": (("--all", "--only", "torino-compliance", "--out", "index"),
                  r"^pass: .*\b0 fail\b", (), True),
    "reproduce low-fidelity": ((), r"^(pass|fail): (\w+ \d+ of \d+(; |$))+$", (), True),
    "reproduce torino-compliance": ((), r"^(pass|fail): (\w+ \d+ of \d+(; |$))+$", (), False),
}  # fmt: skip
FILES = {
    "s.toml": SCENARIO,
    "fit.toml": SCENARIO.replace('"2 s"', '"6 s"'),
    "plan.toml": PLAN,
    "design.toml": DESIGN,
    "log.toml": LOG,
    "watch.toml": LOG.replace('"4 s"', '"16 s"'),
    "flight.csv": FLIGHT,
    "fly.toml": FLY,
    "labels.csv": LABELS,
}


def test_every_command_has_its_answer_here():
    """Published cases and studies print theirs by one function."""
    found = dict(commands())
    missing = {name for name in found if name not in ANSWERS and not shared_writer(found[name])}
    assert missing == set()
    assert ANSWERS.keys() - found.keys() == set()


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the inputs; what a command needs first is made once."""
    folder = tmp_path_factory.mktemp("answers")
    for name, text in FILES.items():
        (folder / name).write_text(text)
    return folder, set()


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[pytest.mark.long] if long else [])
        for n, (_, _, _, long) in ANSWERS.items()
    ],
)
def test_the_first_line_on_stdout_is_the_answer(name, place, capsys, monkeypatch):
    folder, made = place
    monkeypatch.chdir(folder)
    words, pattern, before, _ = ANSWERS[name]
    for command in before:
        if command not in made:
            assert main(list(command)) == 0
            made.add(command)
    if "mission.toml" in words and not (folder / "history").is_dir():
        _history(folder)
    capsys.readouterr()
    code = main([*name.split(), *words])
    captured = capsys.readouterr()
    if pattern is None and code == 2:  # what was asked of the set is not in it
        assert captured.out == ""
        assert captured.err
        return
    assert code in (0, 1), captured.err
    assert pattern is None or re.search(pattern, captured.out.splitlines()[0]), captured.out
    assert captured.out.strip()


def _history(folder):
    import tomlkit

    from tests.prognose.test_predict import FLIGHT as MISSION
    from tests.prognose.test_predict import folder as history

    history(folder / "history", serial=["one"] * 4)
    (folder / "mission.toml").write_text(tomlkit.dumps(MISSION))
    rows = "".join(f"unit {k},{1000 + 137 * k},{k % 3 > 0:d}\n" for k in range(9))
    (folder / "lives.csv").write_text(f"unit,use,failed\n{rows}")
