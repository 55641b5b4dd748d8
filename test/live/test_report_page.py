# SPDX-License-Identifier: Apache-2.0
"""The report of a flight in a real browser: it draws everything from its own file."""
from small_run import BEGIN, FIRST, LATER, announced, statuses

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
    for name in ('map', 'timeline', 'solving', 'gaps'):
        tab.wait_for_selector(f'#{name} .main-svg', timeout=15_000)
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
