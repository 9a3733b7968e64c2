"""A browser for the page's tests: the system's, driven by Playwright; skipped where none is."""

import shutil
import time
from contextlib import contextmanager

import pytest

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no chromium: the page is not driven")


@contextmanager
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        run = driver.chromium.launch(
            executable_path=BROWSER, args=["--no-sandbox", "--disable-gpu"]
        )
        try:
            yield run
        finally:
            run.close()


def opened(run, live, **options):
    """A page of the bench that is drawn, and what it complained of."""
    page = run.new_page(**options)
    complaints = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda line: complaints.append(line.text) if line.type == "error" else None)
    page.goto(live.link)
    until(page, "window.elevonPage?.frames > 2")
    return page, complaints


def until(page, condition, seconds=600.0):
    """Wait for what a page shows; its policy forbids Playwright's own waiting for a condition."""
    end = time.monotonic() + seconds
    while not page.evaluate(condition):
        assert time.monotonic() < end, condition
        page.wait_for_timeout(100)


def press(page, selector):
    """Press without waiting for the picture to stand still: it never does."""
    page.evaluate("selector => document.querySelector(selector).click()", selector)
