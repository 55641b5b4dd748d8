# SPDX-License-Identifier: Apache-2.0
"""The browser of the tests: found, started, waited for."""
import subprocess
from contextlib import contextmanager
from pathlib import Path

FINDER = Path(__file__).parents[2] / 'tools/browser.sh'
WAIT = 60_000  # [ms]
ARGS = [
    '--headless', '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
    '--disable-background-networking', '--disable-component-update', '--disable-sync']


def find():
    """The path of Chromium; '' where there is none."""
    process = subprocess.run([FINDER, '--find'], capture_output=True, text=True)
    return process.stdout.strip()


@contextmanager
def started(path):
    """A running browser, closed at the end. Raises ImportError without playwright."""
    from playwright.sync_api import sync_playwright
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, headless=True, args=ARGS)
        yield browser
        browser.close()


def open_page(page, address):
    """Open an address and wait until the map is drawn."""
    page.goto(address)
    page.wait_for_selector('#map[data-drawn]', timeout=WAIT)


def wait(page, where, expected):
    """Wait until the text of a node contains `expected`."""
    page.wait_for_function(
        '([where, text]) => document.querySelector(where).innerText.includes(text)',
        arg=[where, expected], timeout=WAIT)
