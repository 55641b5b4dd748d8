# SPDX-License-Identifier: Apache-2.0
"""The report of a flight in a real browser: it draws everything from its own file."""
import io

import matplotlib.image
from small_run import BEGIN, FIRST, LATER, announced, state, statuses
from test_live_page import near
from test_map import swipe

from uav_task_alloc.flight_report.flight_history import read_history
from uav_task_alloc.flight_report.page import report_page

EVIL = '<img src=x onerror="document.title=\'taken\'">'


def test_a_report_draws_its_figures_without_any_network_and_runs_nothing_foreign(
        browser, tmp_path):
    end = [announced(BEGIN + 21, [EVIL]), statuses(BEGIN + 21, **{EVIL: 'UNASSIGNED'})]
    path = tmp_path / 'flight.html'
    path.write_text(report_page(read_history([*FIRST, *LATER, *end]), 'x.mcap'))
    tab = browser.new_page(viewport={'width': 1300, 'height': 900})
    requests, errors = [], []
    tab.on('request', lambda request: requests.append(request.url))
    tab.on('pageerror', lambda error: errors.append(str(error)))
    tab.goto(path.as_uri())
    for name in ('map', 'timeline', 'levels', 'solving', 'gaps'):
        tab.wait_for_selector(f'#{name} .main-svg', timeout=90_000)
    assert tab.evaluate("document.querySelectorAll('#timeline .ytick').length") == 6
    assert tab.evaluate("document.querySelectorAll('#map .scatterlayer .trace').length") >= 6
    buttons = tab.evaluate(
        "[...document.querySelectorAll('.modebar-btn')].map(b => b.dataset.title)")
    assert 'Pan' in buttons
    assert 'Share chart...' not in buttons  # it sends the flight to plotly's servers
    assert EVIL in tab.inner_text('#tasks')
    assert tab.title().startswith('Flight of 2027-01-15')
    assert (errors, [url for url in requests if not url.startswith(('file:', 'blob:', 'data:'))]
            ) == ([], [])
    tab.close()


def test_a_report_fits_a_phone(tab, tmp_path):
    gone = [state(BEGIN + 20 + k, 'u2', (500.0, 100.0)) for k in range(1, 9)]
    path = tmp_path / 'flight.html'
    path.write_text(report_page(read_history([*FIRST, *LATER, *gone]), 'a/long/name/' * 9))
    page = tab(viewport={'width': 390, 'height': 844}, is_mobile=True, has_touch=True)
    page.goto(path.as_uri())
    page.wait_for_selector('#gaps .main-svg', timeout=90_000)
    assert page.evaluate('document.documentElement.scrollWidth') == 390
    wide = page.evaluate("""() => [...document.querySelectorAll(
        '.js-plotly-plot, .plot-container, h1, h2, p, details, .scroll')].map(node => [
        node.tagName, node.getBoundingClientRect()]).filter(
        ([, box]) => box.left < 0 || box.right > 390 || box.width < 100)""")
    assert wide == []
    lost = page.locator('#map .textpoint text', has_text='u1 lost at 20 s').bounding_box()
    assert lost['x'] >= 0
    assert lost['x'] + lost['width'] <= 390
    page.wait_for_function(
        "document.querySelectorAll('#map .textpoint text').length === 3", timeout=90_000)
    texts = page.locator('#map .textpoint text').all_text_contents()
    assert sorted(texts) == ['u1', 'u1 lost at 20 s', 'u2']
    for name in ('map', 'levels'):
        legend = page.locator(f'#{name} .legend').first.bounding_box()
        assert legend['x'] >= 0
        assert legend['x'] + legend['width'] <= 390
    shot = matplotlib.image.imread(io.BytesIO(page.locator('#levels').screenshot()))[..., :3]
    assert near(shot, '#e69f00').mean() > 0.001  # u2
    assert near(shot, '#8e0000').mean() > 0.0002  # when u1 was lost
    box = page.locator('#map').bounding_box()
    before = page.evaluate('scrollY')
    swipe(page, box['x'] + 200.0, 600.0)
    page.wait_for_function('before => scrollY > before + 100', arg=before)
