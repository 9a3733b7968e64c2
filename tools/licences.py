"""Licences of all dependencies: `python tools/licences.py` lists them and refuses the others.

Python packages are those of requirements.lock that are installed here, Rust crates those of
Cargo.lock. A package whose licence asks something of whoever ships Elevon may be in an extra or
serve development only: never in what `pip install elevon` brings along.
"""

import json
import re
import subprocess
import sys
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

#: Licences that ask for no more than their text and the names.
ALLOWED = frozenset({
    "0BSD", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-2-Clause", "BSD-3-Clause",
    "CC0-1.0", "HPND", "ISC", "MIT", "MIT-0", "MIT-CMU", "PSF-2.0", "Unicode-3.0", "Zlib",
})  # fmt: skip

#: Packages with other licences, and why they may be in requirements.lock.
OPTIONAL = {
    "moocore": "LGPL-2.1-or-later: of pymoo, in the extra optimise only",
    "hypothesis": "MPL-2.0: tests only",
    "pathspec": "MPL-2.0: of mypy, development only",
}

#: What packages call their licence who do not name it by its SPDX identifier.
_NAMES = {
    "mit license": "MIT", "mit": "MIT", "bsd license": "BSD-3-Clause", "bsd": "BSD-3-Clause",
    "standard 2-clause bsd": "BSD-2-Clause",
    "apache software license": "Apache-2.0", "apache 2.0": "Apache-2.0",
    "isc license (iscl)": "ISC", "isc license": "ISC",
    "python software foundation license": "PSF-2.0",
    "mozilla public license 2.0 (mpl 2.0)": "MPL-2.0",
}  # fmt: skip

#: Packages whose metadata holds the text only, read by a person.
_READ = {"graphemeu": "MIT"}


def main() -> int:
    """Print name, version and licence of every dependency; 1 where one is not allowed."""
    rows = [*python_packages(), *crates()]
    default = installed_by_default()
    wrong = 0
    for name, version, licence in rows:
        why = finding(name, licence, default=name in default)
        note = why or OPTIONAL.get(name, "")
        print(f"{name:28s} {version:12s} {licence}{'  <- ' + note if note else ''}")
        wrong += bool(why)
    if wrong:
        print(f"{wrong} licence(s) not allowed", file=sys.stderr)
    return 1 if wrong else 0


def finding(name: str, licence: str, *, default: bool) -> str:
    """Return what is wrong with a package's licence; empty: nothing."""
    if allowed(licence):
        return ""
    if name not in OPTIONAL:
        return "not an allowed licence"
    return "may not be part of the default installation" if default else ""


def allowed(licence: str) -> bool:
    """Whether an SPDX expression is met by allowed licences alone."""
    words = re.findall(r"\(|\)|[^\s()/]+|/", licence.replace(" WITH ", "\0"))
    value, left = _either([word.replace("\0", " WITH ") for word in words])
    return value and not left


def _either(words: list[str]) -> tuple[bool, list[str]]:
    value, words = _both(words)
    while words and words[0] in {"OR", "/"}:
        other, words = _both(words[1:])
        value = value or other
    return value, words


def _both(words: list[str]) -> tuple[bool, list[str]]:
    value, words = _one(words)
    while words and words[0] == "AND":
        other, words = _one(words[1:])
        value = value and other
    return value, words


def _one(words: list[str]) -> tuple[bool, list[str]]:
    if not words:
        return False, []
    if words[0] == "(":
        value, words = _either(words[1:])
        return value and words[:1] == [")"], words[1:]
    return words[0] in ALLOWED, words[1:]


def python_packages() -> list[tuple[str, str, str]]:
    """Return name, version and licence of the locked packages that are installed."""
    text = (ROOT / "requirements.lock").read_text("utf-8")
    rows = []
    for name in dict.fromkeys(re.findall(r"^([A-Za-z0-9_.-]+)==", text, re.M)):
        try:
            found = distribution(name)
        except PackageNotFoundError:
            continue  # of another system
        rows.append((_plain(name), found.version, _licence(found, _plain(name))))
    return rows


def _licence(found: Distribution, name: str) -> str:
    about = found.metadata
    if expression := about.get("License-Expression"):
        return expression
    kinds = [item.rpartition(" :: ")[2] for item in about.get_all("Classifier") or []
             if item.startswith("License :: ")]  # fmt: skip
    stated = (about.get("License") or "").strip()
    short = [stated] if stated and "\n" not in stated and stated != "UNKNOWN" else []
    names = kinds or short
    known = [_NAMES.get(item.lower(), item) for item in names if item != "OSI Approved"]
    return " AND ".join(known) or _READ.get(name, "unknown")


def installed_by_default() -> set[str]:
    """Return the packages that `pip install elevon` brings along."""
    waiting, found = ["elevon"], set()
    while waiting:
        name = waiting.pop()
        try:
            wanted = distribution(name).requires or []
        except PackageNotFoundError:
            continue
        names = {_plain(re.split(r"[^A-Za-z0-9_.-]", item)[0]) for item in wanted
                 if "extra ==" not in item}  # fmt: skip
        waiting += names - found
        found |= names
    return found


def crates() -> list[tuple[str, str, str]]:
    """Return name, version and licence of the locked crates."""
    words = ["cargo", "metadata", "--locked", "--format-version", "1"]
    made = subprocess.run(words, cwd=ROOT, capture_output=True, check=True)
    return [(item["name"], item["version"], item["license"] or "unknown")
            for item in json.loads(made.stdout)["packages"]]  # fmt: skip


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


if __name__ == "__main__":
    sys.exit(main())
