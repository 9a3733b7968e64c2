"""Look at the built site as a reader does: `python tools/pages/look.py out/docs --out DIR`.

In headless Chromium, at three widths, light and dark: contrast of every text (WCAG 2.1, 4.5, and
3 for large letters), nothing wider than the window, pictures with texts, a visible place of the
keyboard, the search. Needs `chromium` in the path. Writes a picture of each page at each width.
"""

import argparse
import json
import shutil
import sys
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

WIDTHS = (390, 820, 1400)
PAGES = (
    "index.html", "start/five-minutes.html", "how-to/diagnose.html", "gallery/torino-rotary.html",
    "reference/commands/simulate.html", "reference/python-api.html",
    "explanation/theory/rotary.html", "explanation/theory/landing-gear.html",
    "evidence/diagnosis.html", "evidence/published-cases.html", "reference/glossary.html",
    "examples/gallery/first_run.html",
)  # fmt: skip
STEPS = 12
#: ms for a page on a machine that others use.
PATIENCE = 300_000

CONTRAST = (Path(__file__).resolve().parent / "contrast.js").read_text("utf-8")


def main(arguments: list[str]) -> int:
    """Print what is wrong; 1 where anything is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("site", type=Path)
    parser.add_argument("--out", type=Path, default=Path("out/look"))
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    wrong, texts = [], 0
    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        for theme in ("light", "dark"):
            for width in WIDTHS:
                page = browser.new_page(
                    viewport={"width": width, "height": 900}, color_scheme=theme
                )
                for name in PAGES:
                    count, faults = look(page, options.site.resolve() / name)
                    texts += count
                    wrong += [f"{name}, {width}, {theme}: {fault}" for fault in faults]
                    stem = name.replace("/", "-").removesuffix(".html")
                    page.screenshot(path=options.out / f"{stem}-{width}-{theme}.png")
                page.close()
        wrong += by_keyboard(browser.new_page(), options.site.resolve())
        browser.close()
    print("\n".join(wrong), file=sys.stderr)
    print(f"{len(PAGES)} pages, {len(WIDTHS)} widths, 2 themes: {texts} texts, {len(wrong)} wrong")
    return 1 if wrong else 0


def look(page: Page, path: Path) -> tuple[int, list[str]]:
    """Open a page; return how many texts were measured, and what is wrong."""
    page.goto(path.as_uri(), timeout=PATIENCE)
    page.wait_for_timeout(150)
    answer = page.evaluate(CONTRAST)
    wrong = [f"contrast {ratio}: {json.dumps(text)}" for text, ratio in answer["found"]]
    wide = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
    if wide > 1:
        wrong.append(f"{wide} px wider than the window")
    return answer["texts"], wrong


def by_keyboard(page: Page, site: Path) -> list[str]:
    """Walk by the tab key, open the search by its keys, search, and return what did not work."""
    wrong = []
    page.goto((site / "index.html").as_uri(), timeout=PATIENCE)
    reached = set()
    for _ in range(STEPS):
        page.keyboard.press("Tab")
        place = page.evaluate(
            "(() => { const e = document.activeElement, s = getComputedStyle(e);"
            " return [e.tagName + e.textContent.trim().slice(0, 20),"
            " s.outlineStyle !== 'none' || s.boxShadow !== 'none']; })()"
        )
        reached.add(place[0])
        if not place[1]:
            wrong.append(f"keyboard: no mark at {place[0]}")
    if len(reached) < STEPS // 2:
        wrong.append(f"keyboard: only {len(reached)} places in {STEPS} steps")
    page.keyboard.press("Control+k")
    page.keyboard.type("backlash")
    page.keyboard.press("Enter")
    page.wait_for_timeout(2500)
    results = page.locator("#search-results li").count()
    if not results:
        wrong.append("search: no result for a word of many pages")
    return wrong


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
