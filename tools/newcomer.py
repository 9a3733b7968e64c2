"""Be a newcomer: run each block of README and of the guide in a fresh folder and home.

    python tools/newcomer.py                      every page, with the `elevon` of this environment
    python tools/newcomer.py docs/how-to/bench.md --write    put what was printed into the page
    python tools/newcomer.py --wheel dist/elevon-....whl     in a new environment, from the wheel
    python tools/newcomer.py --source             a fresh clone, `make setup`, the first picture

``sh`` and ``python`` blocks run in the order of the page, Python in one process. A ``text`` block
that follows is what they print; ``...`` stands for anything within a line, a line of it for any
lines. Blocks of another kind (``console``: needs another machine) are not run. `make` and `pip`
lines are for --source and --wheel.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from dataclasses import dataclass, field
from pathlib import Path

from prose import ROOT, guide_pages

BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.M | re.S)
END = "#### end of block ####"
FIRST_PICTURE = ["elevon", "simulate", "torino-rotary", "--duration", "2", "--plot", "first.html"]
LIMIT = 900.0
WIDTH = 116
MOST = 9


@dataclass
class Block:
    """One runnable block, and what the page shows of its output."""

    kind: str
    text: str
    expected: str | None = None
    where: tuple[int, int] = (0, 0)
    printed: str = ""
    failure: str = field(default="")


def main(arguments: list[str]) -> int:
    """Run what is requested; 1 where a block fails or prints something else."""
    options = _options(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        if options.source:
            return _from_source(Path(temporary))
        programs = Path(sys.executable).parent
        if options.wheel:
            programs = _from_wheel(Path(temporary), options.wheel)
        wrong = 0
        for page in options.pages or [ROOT / "README.md", *guide_pages()]:
            wrong += run_page(Path(page), programs, write=options.write)
    return 1 if wrong else 0


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pages", nargs="*", type=Path)
    parser.add_argument("--write", action="store_true", help="put the output into the page")
    parser.add_argument("--wheel", type=Path, help="install this wheel in a new environment")
    parser.add_argument("--source", action="store_true", help="clone and build first")
    return parser.parse_args(arguments)


def blocks_of(text: str) -> list[Block]:
    """Return the runnable blocks of a page, each with the output block that follows it."""
    found: list[Block] = []
    for match in BLOCK.finditer(text):
        kind, body = match.groups()
        if kind in ("sh", "python") and not re.match(r"(make|pip|python -m pip) ", body):
            found.append(Block(kind, body, where=(match.end(), match.end())))
        elif kind == "text" and found:
            between = text[found[-1].where[1] : match.start()]
            if not between.strip():
                found[-1].expected, found[-1].where = body, match.span(2)
    return found


def run_page(page: Path, programs: Path, *, write: bool = False) -> int:
    """Run a page; print a line, and what is wrong; return how many blocks are."""
    text = page.read_text("utf-8")
    blocks, began = blocks_of(text), time.monotonic()
    with tempfile.TemporaryDirectory() as temporary:
        folder, home = Path(temporary, "work"), Path(temporary, "home")
        home.mkdir()
        shutil.copytree(ROOT / "examples", folder / "examples")
        environment = _environment(home, programs)
        _run_shell([b for b in blocks if b.kind == "sh"], folder, environment)
        _run_python([b for b in blocks if b.kind == "python"], folder, environment)
    wrong = [block for block in blocks if block.failure or not matches(block)]
    if write:
        for block in reversed([b for b in blocks if b.expected is not None]):
            text = text[: block.where[0]] + shortened(block) + text[block.where[1] :]
        page.write_text(text, "utf-8")
    name = page.resolve().relative_to(ROOT)
    print(f"{name}: {len(blocks)} blocks, {time.monotonic() - began:.0f} s, {len(wrong)} wrong")
    for block in wrong:
        print(f"--- {block.text}--- expected\n{block.expected}--- printed\n{block.printed}")
        print(block.failure, end="")
    return len(wrong)


def matches(block: Block) -> bool:
    """Whether what was printed is what the page shows."""
    if block.expected is None:
        return True
    parts = [re.escape(line) for line in block.expected.rstrip().split("\n")]
    parts = [r"(?:.*\n)*?.*" if p == r"\.\.\." else p.replace(r"\.\.\.", ".*") for p in parts]
    return re.fullmatch("\n".join(parts), block.printed.rstrip()) is not None


def shortened(block: Block) -> str:
    """Return the output as a page shows it: twelve lines, what varies left as it stood."""
    if block.expected and block.expected.strip() and matches(block):
        return block.expected
    text = re.sub(r"(simulated in|time:) [\d.]+ s.*", r"\1 ...", block.printed.rstrip())
    lines = [line.rstrip() for line in text.split("\n")]
    lines = [line if len(line) <= WIDTH else f"{line[: WIDTH - 3]}..." for line in lines]
    return "\n".join(lines if len(lines) <= MOST else [*lines[:MOST], "..."]) + "\n"


def _environment(home: Path, programs: Path) -> dict[str, str]:
    names = ("PYTHONPATH", "LANG", "TMPDIR", "SYSTEMROOT")
    environment = {name: os.environ[name] for name in names if name in os.environ}
    path = os.pathsep.join([str(programs), "/usr/local/bin", "/usr/bin", "/bin"])
    return {**environment, "HOME": str(home), "PATH": path, "COLUMNS": "118"}


def _run_shell(blocks: list[Block], folder: Path, environment: dict[str, str]) -> None:
    for block in blocks:
        code, block.printed, errors = _run(["sh", "-e", "-c", block.text], folder, environment)
        block.failure = f"exit {code}\n{errors}" if code else ""


def _run_python(blocks: list[Block], folder: Path, environment: dict[str, str]) -> None:
    """Run all of a page's Python in one process, as a reader would paste it."""
    if not blocks:
        return
    script = f"\nprint({END!r}, flush=True)\n".join([*(block.text for block in blocks), ""])
    code, printed, errors = _run(["python", "-c", script], folder, environment)
    for block, part in zip(blocks, printed.split(f"{END}\n"), strict=False):
        block.printed = part
    if code:
        blocks[min(printed.count(END), len(blocks) - 1)].failure = f"exit {code}\n{errors}"


def _run(words: list[str], folder: Path, environment: dict[str, str]) -> tuple[int, str, str]:
    done = subprocess.run(
        words, cwd=folder, env=environment, capture_output=True, text=True, check=False,
        timeout=LIMIT, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


def _from_wheel(folder: Path, wheel: Path) -> Path:
    """Install a wheel with all extras in a new environment; print the time to the first picture."""
    began = time.monotonic()
    venv.create(folder / "env", with_pip=True)
    programs = folder / "env" / "bin"
    pip = [str(programs / "python"), "-m", "pip", "install", "--quiet", "--only-binary", ":all:"]
    subprocess.run([*pip, f"elevon[all] @ {wheel.resolve().as_uri()}"], check=True)
    return _first_picture(folder, programs, began, 60.0)


def _from_source(folder: Path) -> int:
    """Clone, build and draw; print the time to the first picture."""
    began = time.monotonic()
    git = ["git", "clone", "--quiet", str(ROOT), str(folder / "elevon")]
    subprocess.run(git, check=True)
    make = ["make", "setup"]
    subprocess.run(make, cwd=folder / "elevon", check=True)
    _first_picture(folder, folder / "elevon" / ".venv" / "bin", began, 300.0)
    return 0


def _first_picture(folder: Path, programs: Path, began: float, limit: float) -> Path:
    words = [str(programs / FIRST_PICTURE[0]), *FIRST_PICTURE[1:]]
    environment = _environment(folder, programs)
    environment.pop("PYTHONPATH", None)
    subprocess.run(words, cwd=folder, env=environment, check=True, capture_output=True)
    print(f"from nothing to the first picture: {time.monotonic() - began:.0f} s ({limit:.0f})")
    return programs


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
