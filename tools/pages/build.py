"""The documentation site: `python tools/pages/build.py` writes out/docs/index.html.

The pages of docs/ are copied to out/site, what is made from the records is written beside them,
links that leave docs/ become pages of their own, and Sphinx makes HTML of it, warnings as errors.
Then every link of the result is followed. Nothing is fetched.
"""

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import check
import evidence
import faults
import records

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SITE = ROOT / "out" / "site"
DOCS = ROOT / "out" / "docs"
LINK = re.compile(r"(?<=\]\()(?!https?:|mailto:|#)([^)\s#]+)(?=[#)])")
LANGUAGES = {
    ".py": "python", ".rs": "rust", ".toml": "toml", ".sh": "sh", ".c": "c", ".m": "matlab",
    ".json": "json", ".csv": "none", ".yml": "yaml", "": "none", ".ipynb": "json", ".cff": "yaml",
}  # fmt: skip


def main() -> int:
    """Build the site; return Sphinx's exit code, or 1 for a broken link."""
    began = time.monotonic()
    pages = Pages()
    for path in sorted((ROOT / "docs").rglob("*")):
        if path.is_file():
            pages.add(path, path.relative_to(ROOT / "docs"))
    for module in (records, evidence, faults):
        for name, content in module.pages(ROOT):
            pages.write(Path(name), content)
    pages.examples()
    pages.sweep()
    code = sphinx()
    if not code:
        code = check.main([str(DOCS)])
    print(f"documentation: {len(pages.written)} files in {time.monotonic() - began:.0f} s: {DOCS}")
    return code


def sphinx() -> int:
    """Run Sphinx, warnings as errors, and return its exit code."""
    words = ["-m", "sphinx", "-W", "--keep-going", "-q", "-j", "2", "-b", "html", "-c", str(HERE)]
    words += ["-d", str(ROOT / "out" / "doctrees"), str(SITE), str(DOCS)]
    return subprocess.run([sys.executable, *words], cwd=ROOT, check=False).returncode


class Pages:
    """The folder that Sphinx reads, written only where something changed."""

    def __init__(self) -> None:
        self.written: set[Path] = set()

    def add(self, path: Path, name: Path) -> None:
        """Copy a file of the repository to a place of the site, its links with it."""
        if path.suffix == ".md":
            self.write(name, self.linked(path, name))
        else:
            self.write(name, path.read_bytes())

    def write(self, name: Path, content: str | bytes) -> None:
        """Write a file unless it has this content already."""
        data = content.encode() if isinstance(content, str) else content
        target = SITE / name
        self.written.add(target)
        if not target.is_file() or target.read_bytes() != data:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)

    def linked(self, path: Path, name: Path) -> str:
        """Return a page with the links that leave docs/ turned to pages of the site."""
        parts = re.split(r"(^```.*?^```)", path.read_text("utf-8"), flags=re.M | re.S)
        for index in range(0, len(parts), 2):
            parts[index] = LINK.sub(lambda m: self._target(path, name, m.group(1)), parts[index])
        return "".join(parts)

    def _target(self, path: Path, name: Path, link: str) -> str:
        target = Path(os.path.normpath(path.parent / link))
        if target.is_relative_to(ROOT / "docs") or not target.is_relative_to(ROOT):
            return link
        inside = target.relative_to(ROOT)
        if not target.exists():
            return link
        page = Path("source") / (inside if target.suffix == ".md" else f"{inside}.md")
        if SITE / page not in self.written:
            self.written.add(SITE / page)
            self._source(target, page)
        return os.path.relpath(page, name.parent)

    def _source(self, target: Path, page: Path) -> None:
        """Write the page of a file outside docs/."""
        inside = target.relative_to(ROOT)
        if target.suffix == ".md":
            self.write(page, f"---\norphan: true\n---\n\n{self.linked(target, page)}")
            return
        if target.is_dir():
            listed = "\n".join(f"* `{p.name}`" for p in sorted(target.iterdir()))
            self.write(page, f"---\norphan: true\n---\n\n# `{inside}`\n\n{listed}\n")
            return
        language = LANGUAGES[target.suffix]
        text = target.read_text("utf-8")
        fence = "`" * 8
        self.write(
            page,
            f"---\norphan: true\n---\n\n# `{inside}`\n\n{fence}{language}\n{text}{fence}\n",
        )

    def examples(self) -> None:
        """Copy the scripts that sphinx-gallery runs, their first line as title."""
        self.write(
            Path("_examples/GALLERY_HEADER.rst"),
            "Examples\n========\n\nEach is run when this site is built; its output\n"
            "is of that run.\n",
        )
        for path in sorted((ROOT / "examples").glob("*.py")):
            if path.stem == "synthetic_flight":  # a program with arguments, for the loads page
                continue
            text = path.read_text("utf-8")
            docstring = re.match(r'"""(.*?)"""\n', text, re.S)
            title = path.stem.replace("_", " ").capitalize()
            head = f'"""\n{title}\n{"=" * len(title)}\n\n{docstring.group(1).strip()}\n"""\n'
            self.write(Path("_examples") / path.name, head + text[docstring.end() :])

    def sweep(self) -> None:
        """Remove what an earlier build wrote and this one did not."""
        for path in sorted(SITE.rglob("*"), reverse=True):
            made = (SITE / "examples" / "gallery").as_posix() in path.as_posix()
            if path.is_file() and path not in self.written and not made:
                path.unlink()
            elif path.is_dir() and not any(path.iterdir()):
                path.rmdir()


if __name__ == "__main__":
    if len(sys.argv) > 1 and sys.argv[1] == "--clean":
        shutil.rmtree(SITE, ignore_errors=True)
        shutil.rmtree(DOCS, ignore_errors=True)
    sys.exit(main())
