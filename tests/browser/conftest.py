"""Headless Chromium, and pages of a folder in it."""

import shutil

import pytest
from playwright.sync_api import sync_playwright


@pytest.fixture(scope="session")
def browser():
    """Headless Chromium."""
    chromium = shutil.which("chromium")
    assert chromium, "these tests need Chromium: apt-get install chromium"
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield started
        started.close()


class Page:
    """A page, the messages on its console, and the addresses that it requested."""

    def __init__(self, browser, file, **settings):
        self.messages, self.requests = [], []
        # Waiting for a condition evaluates text, which the policy of the pages forbids.
        self.tab = browser.new_page(**{"bypass_csp": True} | settings)
        self.tab.on("console", lambda message: self.messages.append(message.text))
        self.tab.on("pageerror", lambda error: self.messages.append(str(error)))
        self.tab.on("request", lambda request: self.requests.append(request.url))
        self.tab.goto(file.as_uri())
        # Plots are drawn when their sizes are first observed, in the frame after the page has loaded.
        if settings.get("java_script_enabled", True):
            self.tab.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def start_replays(self, *scenes):
        """Open some scenes and their viewers, by default all, the last first, since a button disappears when it is pressed."""
        self.tab.locator("#scenes > details").evaluate_all(
            "(all, names) => { for (const one of all) one.open = !names.length || names.includes(one.dataset.scene); }", list(scenes)
        )
        for button in reversed(self.tab.get_by_role("button", name="Replay in 3D").all()):
            button.click()
        return self.tab.locator("[data-replay]").count()


@pytest.fixture
def opened(browser, folder):
    """Open a page of the folder; at the end its console must be empty and the page itself its only request."""
    pages = []

    def open_(name, **settings):
        pages.append(Page(browser, folder / name, **settings))
        return pages[-1]

    yield open_
    for page in pages:
        assert page.messages == []
        assert len(page.requests) == 1
        page.tab.close()
