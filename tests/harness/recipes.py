"""How each command that writes is run here: what is there before, its words, its repair."""

from dataclasses import dataclass

WAVE = """
[scenario]
duration = "0.25 s"
[[scenario.command.terms]]
kind = "sine"
amplitude = "4 deg"
frequency = "8 Hz"
"""

PLAN = f"""
actuator = "torino-rotary"
fidelity = "low"
runs_per_file = 2
record = "output_position,motor_speed@400 Hz"
seeds = [1, 2]
{WAVE}
[[vary]]
parameter = "friction.dynamic"
from = "0.2 N m"
to = "0.4 N m"
count = 3
"""

DESIGN = f"""
actuator = "torino-rotary"
fidelity = "low"
record = []
features = "friction,level@1 kHz"
{WAVE}
[design]
kind = "full_factorial"
[[design.factor]]
parameter = "friction.dynamic"
from = "0.2 N m"
to = "0.4 N m"
[[design.factor]]
parameter = "motor.inertia"
from = "8e-4 kg m^2"
to = "9e-4 kg m^2"
"""

SCENARIO = """
duration = "2 s"
[[command.terms]]
kind = "sine"
amplitude = "5 deg"
frequency = "0.5 Hz"
[[load.brake.terms]]
kind = "constant"
value = "1 N m"
"""

LOG = """
name = "log"
[[step]]
kind = "trace"
name = "log"
duration = "4 s"
command = { terms = [{ kind = "sine", amplitude = "7 deg", frequency = "0.5 Hz" }] }
"""

LABELS = "log,label,unit\n" + "".join(
    f"{name}/log.csv,{'healthy' if name in 'ace' else 'worn'},{k // 2}\n"
    for k, name in enumerate("abcdef")
)

FLY = """
duration = "1 s"
[[command.terms]]
kind = "sine"
amplitude = "5 mm"
frequency = "1 Hz"
[[load.output.terms]]
kind = "constant"
value = "2 kN"
"""

FLIGHT = """time [s],altitude [m],true_airspeed [m/s],angle_of_attack [deg],deflection [deg]
0,1000,100,2,0
1,1000,100,2,5
2,1000,100,2,-10
"""

SPLIT = ("--share", "train=0.5", "--share", "test=0.5")
ROTARY = ("--actuator", "torino-rotary")


@dataclass(frozen=True)
class Recipe:
    """One command as it is run here.

    Attributes
    ----------
    words : tuple of str
        After the command's name; paths are relative to the working folder.
    files : dict of str to str
        Inputs written before.
    before : tuple of tuples
        Whole commands that make what is there before.
    repair : tuple of str, optional
        The command named for what was cut short; by default the same one with ``--force``.
    code : tuple of int
        Exit codes of a whole run.
    long : bool
        Only in the long form, for its time.
    points : int
        Points tried at most in the long form, spread evenly; one run costs the command's time.
    reads : bool
        Changes nothing.
    """

    words: tuple = ()
    files: dict = None
    before: tuple = ()
    repair: tuple = None
    code: tuple = (0,)
    long: bool = False
    points: int = 60
    reads: bool = False


def _folder(*words, **options):
    """A command on the folder of a campaign that is done."""
    ran = (("campaign", "run", "plan.toml", "--out", "set"),)
    before = ran + options.pop("before", ())
    return Recipe(words, {"plan.toml": PLAN}, before, **options)


def _analysis(*words, logs=("log",), **options):
    """A command on logs of the bench, which are recorded before."""
    before = tuple(
        ("bench", "run", "log.toml", *ROTARY, "--fidelity", "low", "--out", name, "--seed", str(k))
        for k, name in enumerate(logs)
    )
    files = {"log.toml": LOG, **options.pop("files", {})}
    return Recipe(words, files, before + options.pop("before", ()), **options)


RUN = ("campaign", "run", "plan.toml", "--out", "set")

RECIPES = {
    "show": Recipe(("torino-rotary", "--svg", "out.svg", "--schema", "out.json", "--force"),
                   before=(("show", "nasa-ballscrew", "--svg", "out.svg", "--schema",
                            "out.json"),)),
    "new": Recipe(("mine.toml", "--linear", "--supply", "28V", "--power", "50W", "--lead", "2mm",
                   "--bench", "bench.toml", "--force"),
                  before=(("new", "mine.toml", "--rotary", "--supply", "48V", "--power", "9W",
                           "--bench", "bench.toml"),)),
    "simulate": Recipe(("torino-rotary", "--scenario", "s.toml", "--fidelity", "low", "--out",
                        "run.parquet", "--seed", "2", "--force"),
                       {"s.toml": SCENARIO},
                       (("simulate", "torino-rotary", "--scenario", "s.toml", "--fidelity", "low",
                         "--out", "run.parquet", "--seed", "1"),)),
    "campaign run": Recipe(("plan.toml", "--out", "set"), {"plan.toml": PLAN}),
    "campaign resume": _folder("set", before=(("-", "set/runs/*/block_00001.parquet"),),
                               repair=("campaign", "resume", "set")),
    "campaign status": _folder("set", reads=True),
    "campaign effects": Recipe(("set", "--response", "friction_current", "--report", "out.html",
                                "--force"),
                               {"plan.toml": DESIGN},
                               (RUN, ("campaign", "effects", "set", "--response", "load_current",
                                      "--report", "out.html"))),
    "dataset describe": _folder("set", reads=True),
    "dataset verify": _folder("set", reads=True),
    "dataset split": _folder("set", *SPLIT, repair=("dataset", "repair", "set")),
    "dataset repair": _folder("set", before=(("-", "set/manifest.json"),),
                              repair=("dataset", "repair", "set")),
    "dataset export": _folder("set", "--out", "copy", "--force",
                              before=(("dataset", "export", "set", "--out", "copy", "--runs",
                                       "0"),)),
    "compare": Recipe(("torino-rotary", "--scenario", "s.toml", "--after", "0.5", "--out", "cmp",
                       "--force"), {"s.toml": SCENARIO}, long=True, points=12),
    "response": Recipe(("torino-rotary", "--from", "2 Hz", "--to", "8 Hz", "--fidelity", "low",
                        "--plot", "bode.png", "--force"), long=True, points=12),
    "fit-low": Recipe(("torino-rotary", "--scenario", "s.toml", "--set", "low.band_ratio=0.9",
                       "--out", "fit.toml", "--report", "fit.html", "--force"),
                      {"s.toml": SCENARIO.replace("2 s", "5 s")}, long=True, points=8),
    "bench run": Recipe(("log.toml", *ROTARY, "--fidelity", "low", "--out", "logs", "--force"),
                        {"log.toml": LOG},
                        (("bench", "run", "log.toml", *ROTARY, "--fidelity", "low", "--out",
                          "logs", "--seed", "5"),)),
    "bench fly": Recipe(("fly.toml", "--actuator", "nasa-ballscrew", "--fidelity", "low", "--out",
                         "flown", "--switch", "0.5 s", "--force"), {"fly.toml": FLY},
                        (("bench", "fly", "fly.toml", "--actuator", "nasa-ballscrew", "--fidelity",
                          "low", "--out", "flown", "--switch", "0.5 s", "--seed", "5"),)),
    "loads": Recipe(("flight.csv", "--area", "0.5 m2", "--chord", "400 mm", "--c-delta", "-0.4",
                     "--actuator", "nasa-ballscrew", "--arm", "100 mm", "--out", "load.toml",
                     "--force"), {"flight.csv": FLIGHT}),
    "export fmu": Recipe(("torino-rotary", "-o", "a.fmu", "--fidelity", "low", "--force"),
                         before=(("export", "fmu", "nasa-ballscrew", "-o", "a.fmu"),)),
    "export run": Recipe(("torino-rotary", "-o", "a.json", "--force"),
                         before=(("export", "run", "nasa-ballscrew", "-o", "a.json"),)),
    "import": _analysis("log/log.csv", "--out", "rec.parquet", "--force"),
    "calibrate": Recipe(("drops.csv", *ROTARY, "--out", "stiff.toml", "--force"),
                        {"drops.csv": "@torino_compliance"}, code=(0, 1)),
    "validate": _analysis("log/log.csv", *ROTARY, "--transient", "1", "--report", "val.html",
                          "--force", long=True, points=10, code=(0, 1)),
    "plot": _analysis("log/log.csv", "--out", "log.html", "--force",
                      before=(("plot", "base/log.csv", "--out", "log.html"),),
                      logs=("log", "base"), long=True, points=8),
    "doctor": _analysis("log/log.csv", *ROTARY, "--baseline", "base/log.csv", "--out", "look",
                        "--force", logs=("log", "base"), long=True, points=8, code=(0, 1)),
    "diagnose": _analysis("log/log.csv", *ROTARY, "--baseline", "base/log.csv", "--report",
                          "dia.html", "--append", "history", "--usage", "600 flights", "--force",
                          logs=("log", "base"), long=True, points=8, code=(0, 1)),
    "predict": Recipe(("history", *ROTARY, "--mission", "mission.toml", "--particles", "500",
                       "--report", "rul.html", "--force"), {"history": "@history"}, long=True,
                      points=8, code=(0, 1)),
    "next-inspection": Recipe(
        ("history", *ROTARY, "--mission", "mission.toml", "--particles", "500", "--report",
         "look.html", "--force"), {"history": "@history"}, long=True, points=8, code=(0, 1)),
    "safety": Recipe(("pisa-landing-gear", "--every", "8000", "--out", "out", "--force"),
                     code=(0, 1), long=True, points=8),
    "fleet": Recipe(("history", "other", *ROTARY, "--mission", "mission.toml", "--report",
                     "fleet.html", "--force"), {"history": "@history", "other": "@history"},
                    long=True, points=8, code=(0, 1)),
    "learn": _analysis(*(f"{name}/log.csv" for name in "abcdef"), "--labels", "labels.csv",
                       *ROTARY, "--out", "model.npz", "--force", logs=tuple("abcdef"),
                       files={"labels.csv": LABELS}, long=True, points=4),
    "learn-growth": Recipe(("history", "other", *ROTARY, "--mission", "mission.toml", "--out",
                            "growth.json", "--force"),
                           {"history": "@history", "other": "@history"}, long=True, points=4),
    "live": Recipe(("torino-rotary", "--fidelity", "low", "--static", "page", "--force"), long=True,
                   points=4),
    "demo": Recipe(("--out", "demo", "--force"), long=True, points=2,
                   code=(0, 1)),
    "reproduce": Recipe(("--all", "--only", "torino-compliance", "--out", "index", "--force"),
                        long=True, points=12),
    "reproduce torino-compliance": Recipe(("--out", "rep", "--force"), code=(0, 1), before=(
        ("reproduce", "torino-compliance", "--out", "rep", "--seed", "3"),)),
    "reproduce pisa-hydraulic": Recipe(("--out", "rep", "--force"), code=(0, 1), long=True,
                                       points=12),
    "studies inspection-error": Recipe(("--runs", "runs", "--units", "2"),
                                       {"runs": "@inspections"}, code=(0, 1), long=True,
                                       points=2),
}  # fmt: skip

#: Reproductions write by one function, which the cases above run; the harness checks that it is.
SHARED = "reproduce torino-compliance"
