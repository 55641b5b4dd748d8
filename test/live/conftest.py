# SPDX-License-Identifier: Apache-2.0
"""A page served from a small run, and a real browser."""
import os

import chromium
import pytest
from small_run import FIRST, LATER, Run

from uav_task_alloc.live.server import PageServer


@pytest.fixture
def run():
    return Run().add(*FIRST).add(*LATER)


@pytest.fixture
def serve():
    """serve(snapshots, port=0) -> a PageServer that has started; stopped at the end."""
    def serve(snapshots, port=0, host='127.0.0.1'):
        serve.servers.append(PageServer(snapshots, host, port))
        serve.servers[-1].start()
        return serve.servers[-1]

    serve.servers = []
    yield serve
    for server in serve.servers:
        server.stop()


@pytest.fixture(scope='session')
def browser():
    """A headless Chromium; skipped where there is none, unless REQUIRE_BROWSER=1."""
    path = chromium.find()
    if not path:
        assert os.environ.get('REQUIRE_BROWSER') != '1', 'REQUIRE_BROWSER=1, and no Chromium'
        pytest.skip('no Chromium found: `tools/browser.sh` installs one')
    pytest.importorskip('playwright')
    with chromium.started(path) as browser:
        yield browser


@pytest.fixture(scope='module')
def window(browser):
    """(tab, server) for one page after another: a tab has to read plotly.js only once."""
    server = PageServer(Run().snapshots, '127.0.0.1', 0)
    server.start()
    context = browser.new_context()
    yield context.new_page(), server
    context.close()
    server.stop()


@pytest.fixture
def tab(browser):
    """tab(**options) -> a page in a new context, as Browser.new_context; closed at the end."""
    contexts = []

    def tab(**options):
        contexts.append(browser.new_context(**options))
        return contexts[-1].new_page()

    yield tab
    for context in contexts:
        context.close()


@pytest.fixture
def view(window):
    """view(snapshots) -> a page of it, drawn; fails on any error that the page reports."""
    page, server = window
    errors = []

    def on_error(error):
        errors.append(str(error))

    def on_console(message):
        if message.type == 'error' and 'ERR_' not in message.text:  # net::ERR_: no server
            errors.append(message.text)

    def view(snapshots, scheme='light'):
        server.snapshots = snapshots
        page.set_viewport_size({'width': 1600, 'height': 900})
        page.emulate_media(color_scheme=scheme)
        chromium.open_page(page, server.address)
        return page

    page.on('pageerror', on_error)
    page.on('console', on_console)
    view.server = server
    yield view
    page.remove_listener('pageerror', on_error)
    page.remove_listener('console', on_console)
    assert errors == []
