# SPDX-License-Identifier: Apache-2.0
"""The demand on the map of the live page: off at first, densest where most tasks came from."""
import chromium
import numpy as np
import pytest
from small_run import BEGIN, Run, announced, state, statuses
from test_live_page import pixels

DESK = {'width': 1440, 'height': 900}
SPOT, ALONE = (1000.0, 1000.0), (4000.0, 3000.0)  # [m] of many tasks, and of one


def crowd():
    rng = np.random.default_rng(5)
    places = {f't{k}': rng.normal(SPOT, 150.0) for k in range(40)} | {'far': ALONE}
    tasks = {**announced(BEGIN, places), 'tasks': [
        {'id': name, 'position': [*map(float, place), 40.0]} for name, place in places.items()]}
    return Run().add(tasks, statuses(BEGIN, **dict.fromkeys(places, 'PENDING')),
                     state(BEGIN, 'u1', (0.0, 0.0)))


@pytest.fixture
def page(tab, serve):
    page = tab(viewport=DESK, color_scheme='light')
    chromium.open_page(page, serve(crowd().snapshots).address)
    return page


def press(page):
    """Press the button, and wait until the map is drawn again."""
    drawn = page.evaluate("document.querySelector('#map').dataset.drawn")
    page.locator('#map .heat').click()
    page.mouse.move(0, 0)
    page.wait_for_function(
        "before => document.querySelector('#map').dataset.drawn !== before", arg=drawn)


def redness(image, page, place, radius=25):
    """How much redder than blue the map is around a place [m]."""
    x, y, scale = map(float, page.evaluate(
        "document.querySelector('#map').dataset.view").split())
    column = image.shape[1] / 2 + (place[0] - x) * scale
    row = image.shape[0] / 2 - (place[1] - y) * scale
    part = image[int(row) - radius:int(row) + radius, int(column) - radius:int(column) + radius]
    return float((part[..., 0] - part[..., 2]).mean())


def test_the_demand_is_shown_and_hidden_by_its_button(page):
    button, row = page.locator('#map .heat'), page.locator('#legend .heat-row')
    before = pixels(page, '#map')
    assert (button.get_attribute('aria-pressed'), row.is_visible()) == ('false', False)
    press(page)
    shown = pixels(page, '#map')
    assert (button.get_attribute('aria-pressed'), row.is_visible()) == ('true', True)
    at = {name: redness(shown, page, place) - redness(before, page, place)
          for name, place in (('spot', SPOT), ('alone', ALONE), ('empty', (1000.0, 3000.0)))}
    assert at['spot'] > 0.1
    assert at['spot'] > 3.0 * at['alone']
    assert abs(at['empty']) < 0.02
    press(page)
    assert (button.get_attribute('aria-pressed'), row.is_visible()) == ('false', False)
    assert abs(redness(pixels(page, '#map'), page, SPOT) - redness(before, page, SPOT)) < 0.01


def test_a_mouse_presses_the_buttons_of_the_map(page):
    def scale():
        return float(page.evaluate("document.querySelector('#map').dataset.view").split()[2])
    before = scale()
    page.locator('#map .in').click()
    page.wait_for_function("""before => Number(
        document.querySelector('#map').dataset.view.split(' ')[2]) > before""", arg=before,
        timeout=5000)
    assert scale() / before == pytest.approx(1.6)


def density(page, places):
    return page.evaluate("""async places => {
        const {density} = await import('./demand.js'), found = density(places);
        return found && {...found, cells: [...found.cells]}; }""", places)


def test_the_density_is_largest_at_the_spot_and_symmetric(page):
    found = density(page, [[0.0, 0.0], [0.0, 0.0], [800.0, 0.0]])
    cells = np.array(found['cells']).reshape(found['rows'], found['columns'])
    assert cells.max() == 1.0
    assert np.allclose(cells, cells[::-1])  # one row of tasks, north and south alike
    row = cells[found['rows'] // 2]
    peaks = [k for k in range(1, len(row) - 1) if row[k - 1] < row[k] > row[k + 1]]
    at = [found['west'] + (k + 0.5) * found['side'] for k in peaks]
    assert at == pytest.approx([0.0, 800.0], abs=found['side'])
    assert row[peaks[1]] == pytest.approx(0.5, abs=0.01)


def test_without_a_known_place_there_is_no_density(page):
    assert density(page, []) is None
    assert density(page, [[None, None]]) is None
    assert density(page, [[5.0, 5.0]])['tasks'] == 1
