"""Debian's Chromium without a screen, for what can only be tried in a browser."""

import shutil
from contextlib import contextmanager

import pytest

FLAGS = (
    "--no-sandbox",  # in a container there is none to be had
    "--use-gl=angle",
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def chromium():
    """Where Chromium is; the test is skipped where there is none."""
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    if found is None:
        pytest.skip("there is no chromium here; apt-get install chromium")
    return found


@contextmanager
def browser():
    """A browser of its own, with an empty profile, by Playwright."""
    where = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        program = playwright.chromium.launch(executable_path=where, args=FLAGS)
        yield program
        program.close()


class Overheard:
    """What a page asked for and complained of.

    Attributes
    ----------
    requests, complaints : list of str
    """

    def __init__(self, page):
        self.requests, self.complaints = [], []
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("console", self._said)

    def _said(self, message):
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)
