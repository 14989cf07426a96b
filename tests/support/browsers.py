"""A browser without a window, for tests of pages."""

import base64
import contextlib
import gzip
import shutil

import numpy as np

from cspr_jax.outputs.plots.pages.page import TYPES

# The renderer is software, and the sandbox of a container's root is none.
SWITCHES = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE = 120_000  # ms


@contextlib.contextmanager
def started():
    """A browser, for many pages."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as player:
        browser = player.chromium.launch(executable_path=shutil.which("chromium"), args=SWITCHES)
        try:
            yield browser
        finally:
            browser.close()


@contextlib.contextmanager
def shown(browser, path):
    """A page that is ready, and what it told on its console or tried to fetch, which should be nothing."""
    told = []
    tab = browser.new_page(viewport={"width": 1300, "height": 900})
    tab.set_default_timeout(PATIENCE)
    tab.on("console", lambda message: told.append(message.text) if message.type == "error" else None)
    tab.on("pageerror", lambda error: told.append(str(error)))
    tab.on("request", lambda request: told.append(request.url) if not _is_own(request.url) else None)
    tab.goto(path.as_uri())
    tab.wait_for_function("document.documentElement.dataset.ready === 'yes'")
    try:
        yield tab, told
    finally:
        tab.close()


@contextlib.contextmanager
def opened(path):
    """The same of a browser that is started for it."""
    with started() as browser, shown(browser, path) as page:
        yield page


def _is_own(address):
    return address.startswith(("file:", "data:", "blob:"))


def unpacked(array):
    """Values of a page's array, as a browser has them."""
    name = next(name for name, other in TYPES.items() if other == array["type"])
    data = gzip.decompress(base64.b64decode(array["data"]))
    return np.frombuffer(data, np.dtype(name).newbyteorder("<"))
