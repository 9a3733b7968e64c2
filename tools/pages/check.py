"""Follow every link of a built site: `python tools/pages/check.py out/docs`.

Each page's links to pages, anchors, pictures, scripts and styles of the site must be there, each
picture has a text, and nothing is fetched from elsewhere.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Links, anchors and pictures of one page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.ids: set[str] = set()
        self.bare: list[str] = []
        self.feed(path.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag names."""
        found = dict(attrs)
        self.ids.update(value for key in ("id", "name") if (value := found.get(key)))
        if tag == "a" and found.get("href"):
            self.links.append(found["href"] or "")
        for key in ("src", "href"):
            if tag in ("img", "script", "link", "source", "iframe") and found.get(key):
                self.fetched.append(found[key] or "")
        # A thumbnail stands beside its title, in one link: a text would be read twice.
        decoration = found.get("alt") == "" and "_thumb." in (found.get("src") or "")
        if tag == "img" and not found.get("alt") and not decoration:
            self.bare.append(found.get("src") or "?")


def main(arguments: list[str]) -> int:
    """Print each broken link; 1 where there is any."""
    root = Path(arguments[0]).resolve()
    files = (path for path in sorted(root.rglob("*.html")) if "_static" not in path.parts)
    pages = {path: Page(path) for path in files}
    wrong, inner, outer = [], 0, 0
    for path, page in pages.items():
        wrong += [f"{path.relative_to(root)}: picture without a text: {name}" for name in page.bare]
        for link in page.links + page.fetched:
            parts = urlsplit(link)
            if parts.scheme in ("http", "https", "mailto", "data") or parts.netloc:
                outer += 1
                if link in page.fetched and parts.scheme != "data":
                    wrong.append(f"{path.relative_to(root)}: fetched from elsewhere: {link}")
                continue
            inner += 1
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                wrong.append(f"{path.relative_to(root)}: no such file: {link}")
            elif target in pages and unquote(parts.fragment) not in {"", *pages[target].ids}:
                wrong.append(f"{path.relative_to(root)}: no such anchor: {link}")
    print("\n".join(wrong), file=sys.stderr)
    print(f"{len(pages)} pages, {inner} links within, {outer} to elsewhere, {len(wrong)} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
