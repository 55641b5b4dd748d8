# SPDX-License-Identifier: Apache-2.0
"""Map and layout of the live page in a real browser, at the sizes of a desk and a phone."""
import io
import math
import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import ClassVar

import chromium
import matplotlib.image
import numpy as np
import pytest
from small_run import BEGIN, FIRST, LATER, Run, announced, listed, planned, state, statuses, zones
from test_live_page import find, near, pixels, share, text

from uav_task_alloc.geometry.frames import Origin, to_enu, to_geodetic
from uav_task_alloc.live.tiles import tile_source

DESK, PHONE = {'width': 1440, 'height': 900}, {'width': 390, 'height': 844}
SIZES = pytest.mark.parametrize('size', [DESK, PHONE], ids=['desk', 'phone'])
ORIGIN = {'kind': 'origin', 'wall': BEGIN, 'latitude': 47.397742, 'longitude': 8.545594,
          'altitude_amsl': 488.0}
BLUE = '#0072b2'  # of the first UAV, in the light theme
GREEN = np.full((256, 256, 3), (0.0, 0.5, 0.0))  # a tile
UNDER_THE_VEIL = '#59ac59'  # the same on the map, under white


@pytest.fixture
def shown(tab, serve):
    """shown(run, size, tiles=None) -> the page of a run in a window of its own, drawn."""
    def shown(run, size, tiles=None):
        options = {'has_touch': True, 'is_mobile': True} if size is PHONE else {}
        page = tab(viewport=size, color_scheme='light', **options)
        server = serve(run.snapshots)
        server.tiles = tiles
        chromium.open_page(page, server.address)
        return page
    return shown


def crowd():
    """A fleet at one place among many tasks, two zones and a UAV that is lost."""
    names = [f't{k:02}' for k in range(40)]
    places = {name: [40.0 * (k % 8), 30.0 * (k // 8), 40.0] for k, name in enumerate(names)}
    tasks = {**announced(BEGIN, names), 'tasks': [
        {'id': name, 'position': place} for name, place in places.items()]}
    ids = [f'uav_{k}' for k in range(6)]
    lists = {uav: names[k::6] for k, uav in enumerate(ids)}
    begin = [tasks, zones(BEGIN, ('dome', 80.0, 60.0, 30.0), ('tower', 90.0, 62.0, 20.0)),
             *(state(BEGIN, uav, (100.0 + 3.0 * k, 50.0)) for k, uav in enumerate(ids)),
             *(listed(BEGIN, uav, 1, tasks) for uav, tasks in lists.items()),
             planned(BEGIN, 1, 'ADD', **lists),
             statuses(BEGIN, **{name: f'ASSIGNED {uav}' for uav, tasks in lists.items()
                                for name in tasks})]
    later = [state(BEGIN + 20, uav, (100.0 + 3.0 * k, 50.0)) for k, uav in enumerate(ids[1:])]
    return Run().add(*begin, ORIGIN).add(*later)


def boxes(page, where):
    """(text, left, top, right, bottom) of all nodes; [px] of the window."""
    return page.evaluate("""where => [...document.querySelectorAll(where)].map(node => {
        const box = node.getBoundingClientRect();
        return [node.textContent, box.left, box.top, box.right, box.bottom]; })""", where)


def overlapping(rows):
    return [(a[0], b[0]) for k, a in enumerate(rows) for b in rows[k + 1:]
            if a[1] < b[3] and b[1] < a[3] and a[2] < b[4] and b[2] < a[4]]


@SIZES
def test_labels_overlap_neither_each_other_nor_controls_and_stay_on_the_map(shown, size):
    page = shown(crowd(), size)
    labels = boxes(page, '#map .label')
    assert len(labels) >= 10
    assert {'uav_1', 'uav_5'} <= {text.split()[0] for text, *_ in labels}
    assert any(text.startswith('uav_0 silent 0:20') for text, *_ in labels)
    assert overlapping(labels + boxes(page, '#map .controls')) == []
    [(_, left, top, right, bottom)] = boxes(page, '#map')
    assert all(left <= a and top <= b and c <= right and d <= bottom for _, a, b, c, d in labels)


@SIZES
def test_no_text_of_a_card_overlaps_another_or_leaves_the_card(shown, size):
    page = shown(crowd(), size)
    cards = boxes(page, '#uavs details')
    assert overlapping(cards) == []
    assert overlapping(boxes(page, '#uavs .figures > span')) == []
    assert overlapping(boxes(page, 'header > *')) == []
    assert all(left >= 0 and right <= size['width'] for _, left, _, right, _ in cards)


@pytest.mark.parametrize('course', [0, 45, 90, 180, 250])
def test_a_uav_points_where_it_flies(shown, course):
    turn = math.radians(course)
    flying = state(BEGIN, 'u1', (0.0, 0.0), velocity=[9 * math.sin(turn), 9 * math.cos(turn), 0.0])
    page = shown(Run().add(flying, state(BEGIN, 'u2', (300.0, 200.0))), DESK)
    tip, middle = page.evaluate("""() => {
        const path = document.querySelector('#map [data-uav=u1] path');
        const at = path.getScreenCTM(), point = y => new DOMPoint(0, y).matrixTransform(at);
        return [-14, 0].map(y => [point(y).x, point(y).y]); }""")
    east, north = tip[0] - middle[0], middle[1] - tip[1]
    assert math.degrees(math.atan2(east, north)) % 360 == pytest.approx(course, abs=1.0)
    [(_, left, top, _, _)] = boxes(page, '#map')
    x, y = round(middle[0] - left), round(middle[1] - top)
    image = pixels(page, '#map')[y - 18:y + 19, x - 18:x + 19]
    rows, columns = np.nonzero(near(image, BLUE))
    offsets = np.column_stack([columns - 18, 18 - rows])  # east, north
    ahead = offsets @ [math.sin(turn), math.cos(turn)]
    aside = np.abs(offsets @ [math.cos(turn), -math.sin(turn)])
    assert aside[ahead > 6.0].max() < 4.5  # the tip is narrow, the tail is wide
    assert aside[ahead < -6.0].max() > 6.0
    assert page.get_attribute('#map [data-uav=u2] path', 'd').startswith('M-8,0 a8,8')  # a dot


def test_what_is_outside_of_the_fence_area_is_covered_and_named(shown, run):
    corners = [[0.0, 200.0], [600.0, 200.0], [600.0, 600.0], [0.0, 600.0]]
    area = {'kind': 'fence_area', 'wall': BEGIN, 'corners': corners}
    page = shown(Run().add(*FIRST, area), DESK)
    image = pixels(page, '#map canvas')
    edge = image[image.shape[0] // 2, 4]  # left of the area
    assert edge[0] - edge[2] > 0.05
    page.hover('#map', position={'x': 4, 'y': image.shape[0] // 2})
    assert text(page, '#map .tip') == 'outside of fence_area: no plan leads here'
    page = shown(run, DESK)
    assert np.ptp(pixels(page, '#map canvas')[image.shape[0] // 2, 4]) < 0.05
    page.hover('#map', position={'x': 4, 'y': image.shape[0] // 2})
    assert text(page, '#map .tip') == ''


def test_the_map_takes_most_of_the_width_of_a_desk(shown, run):
    page = shown(run, DESK)
    [(_, left, top, right, bottom)] = boxes(page, '#map')
    assert (right - left) / DESK['width'] > 0.65
    assert (bottom - top) / DESK['height'] > 0.7
    assert page.evaluate('document.documentElement.scrollHeight') <= DESK['height']
    [(_, uavs, first, _, _)] = boxes(page, '#uav-box')
    assert all(first < other for _, _, other, _, _ in boxes(page, '#rest section'))
    assert uavs > right


def test_a_phone_shows_the_uavs_first_then_the_map(shown, run):
    page = shown(run, PHONE)
    tops = [top for _, _, top, _, _ in boxes(page, 'section')]
    assert tops == sorted(tops)
    assert [box[2] for box in boxes(page, '#uav-box, #map-box')] == tops[:2]
    assert page.evaluate('document.documentElement.scrollWidth') == PHONE['width']


@SIZES
def test_names_of_uavs_do_not_overlap_the_bars_of_their_services(shown, size):
    uav = 'inspector_of_the_north_eastern_power_line_17'
    names = [f't{k}' for k in range(9)]  # the first is soon
    page = shown(Run().add(announced(BEGIN, names), state(BEGIN, uav, (0.0, 0.0)),
                           listed(BEGIN, uav, 1, names),
                           planned(BEGIN, 1, 'ADD', **{uav: names})), size)
    page.wait_for_selector('#gantt rect', state='attached')
    assert overlapping(boxes(page, '#gantt text, #gantt rect')) == []
    assert boxes(page, '#gantt text')[0][0].endswith(uav)  # its title


def middle_of_map(page):
    page.locator('#map').scroll_into_view_if_needed()
    [(_, left, top, right, bottom)] = boxes(page, '#map')
    return (left + right) / 2, (top + bottom) / 2


def swipe(page, x, y):
    """One finger moves 180 px up."""
    finger = page.context.new_cdp_session(page)
    for kind, moved in (('touchStart', 0), *(('touchMove', -20 * k) for k in range(10))):
        finger.send('Input.dispatchTouchEvent',
                    {'type': kind, 'touchPoints': [{'x': x, 'y': y + moved}]})
    finger.send('Input.dispatchTouchEvent', {'type': 'touchEnd', 'touchPoints': []})


def test_a_swipe_over_the_map_scrolls_the_page(shown, run):
    page = shown(run, PHONE)
    x, y = middle_of_map(page)
    view, scrolled = page.get_attribute('#map', 'data-view'), page.evaluate('scrollY')
    swipe(page, x, y)
    page.wait_for_function('before => scrollY > before + 100', arg=scrolled)
    assert page.get_attribute('#map', 'data-view') == view


def test_two_fingers_zoom_the_map_and_not_the_page(shown, run):
    page = shown(run, PHONE)
    x, y = middle_of_map(page)
    view, scrolled = page.get_attribute('#map', 'data-view'), page.evaluate('scrollY')
    page.context.new_cdp_session(page).send(
        'Input.synthesizePinchGesture', {'x': x, 'y': y, 'scaleFactor': 2.0})
    page.wait_for_function(
        "before => document.querySelector('#map').dataset.view !== before", arg=view)
    assert page.evaluate('[scrollY, visualViewport.scale]') == [scrolled, 1]


def test_the_map_obeys_the_keyboard(shown, run):
    page = shown(run, DESK)
    page.focus('#map')
    views = [page.get_attribute('#map', 'data-view')]
    for key in ('ArrowLeft', 'ArrowUp', '+', '-', '0'):
        page.keyboard.press(key)
        if key != '0':
            page.wait_for_function(
                "before => document.querySelector('#map').dataset.view !== before", arg=views[-1])
        views.append(page.get_attribute('#map', 'data-view'))
    page.wait_for_function(
        "before => document.querySelector('#map').dataset.view === before", arg=views[0])


def test_places_are_in_degrees_where_the_origin_is_known(shown, run):
    page = shown(run.add(ORIGIN), DESK)
    page.fill('#find', 't2')
    chromium.wait(page, '#where', f'It is at {degrees(100.0, 500.0)}, 528 m AMSL.')
    page.click('#uavs details:nth-child(2) summary')
    chromium.wait(page, '#uavs details:nth-child(2)', f'{degrees(500.0, 100.0)}, 528 m AMSL')
    page.hover('#map')
    chromium.wait(page, '#map-foot', '47.4')


def degrees(east, north):
    origin = Origin(*(ORIGIN[name] for name in ('latitude', 'longitude', 'altitude_amsl')))
    latitude, longitude, _ = to_geodetic(origin, (east, north, 40.0))
    return f'{latitude:.6f}, {longitude:.6f}'


def test_everything_that_can_be_clicked_is_reached_by_the_tab_key(shown, run):
    page, reached = shown(run, DESK), []
    focused = """() => { const node = document.activeElement;
        return node.id || node.className || node.tagName + node.textContent.slice(0, 2); }"""
    while not reached or reached[-1] != 'scrub':
        page.keyboard.press('Tab')
        reached.append(page.evaluate(focused))
        assert len(reached) < 60
    lists = {'task', 'SUMMARYEa', 'events', 'left', 'uav-box', 'rest'}  # some only if they scroll
    assert [name for name in reached if name not in lists] == [
        'theme', 'SUMMARYu1', 'SUMMARYu2', 'map', 'in', 'out', 'fit', 'heat', 'find', 'live',
        'scrub']
    page.focus('#uavs summary')
    page.keyboard.press('Enter')
    page.wait_for_selector('#uavs details[open]')


PLACES = [(0.0, 0.0, 0.0), (1500.0, -2500.0, 120.0), (-40e3, 30e3, 3000.0), (2e3, 9e5, 0.0)]


@pytest.mark.parametrize('origin', [(47.4, 8.5, 488.0), (-33.9, 151.2, 0.0), (0.0, -179.9, 10.0),
                                    (78.2, 15.6, 5.0)])
def test_the_page_converts_to_degrees_and_back_as_the_package_does(shown, run, origin):
    page = shown(run, DESK)
    here = page.evaluate("""async ([origin, points]) => {
        const frame = (await import('/geo.js')).frameOf(origin);
        return points.map(point => frame.degrees(point)); }""", [origin, PLACES])
    there = [to_geodetic(Origin(*origin), place) for place in PLACES]
    np.testing.assert_allclose(here, there, rtol=0.0, atol=1e-6)
    back = page.evaluate("""async ([origin, points]) => {
        const frame = (await import('/geo.js')).frameOf(origin);
        return points.map(point => frame.enu(...point)); }""", [origin, there])
    np.testing.assert_allclose(back, [to_enu(Origin(*origin), *place) for place in there],
                               rtol=0.0, atol=1e-5)


def test_tiles_lie_where_they_belong_and_missing_ones_do_no_harm(shown, tmp_path):
    lat, lon = ORIGIN['latitude'], ORIGIN['longitude']
    n = 2 ** 16
    column = int(n * (lon + 180.0) / 360.0)
    row = int(n * (1.0 - math.asinh(math.tan(math.radians(lat))) / math.pi) / 2.0)
    folder = tmp_path / 'tiles/16' / str(column)
    folder.mkdir(parents=True)
    matplotlib.image.imsave(folder / f'{row}.png', GREEN)
    origin = Origin(lat, lon, ORIGIN['altitude_amsl'])

    def corner(x, y):
        return to_enu(origin, math.degrees(math.atan(math.sinh(math.pi * (1 - 2 * y / n)))),
                      360.0 * x / n - 180.0, origin.altitude_amsl)

    (west, north, _), (east, south, _) = corner(column, row), corner(column + 1, row + 1)
    run = Run().add(ORIGIN, state(BEGIN, 'u1', (west - 100.0, south - 100.0)),
                    state(BEGIN, 'u2', (east + 100.0, north + 100.0)))
    page = shown(run, DESK, tile_source(str(tmp_path / 'tiles'), '(c) nobody'))
    chromium.wait(page, '#map-foot', '(c) nobody')
    page.wait_for_function('() => performance.getEntriesByType("resource").some('
                           'entry => entry.name.includes("/tiles/16/"))')
    image = wait_for_pixels(page, UNDER_THE_VEIL)
    rows, columns = np.nonzero(near(image, UNDER_THE_VEIL))
    x, y, scale = (float(v) for v in page.get_attribute('#map', 'data-view').split())
    height, width = image.shape[:2]
    expected = [width / 2 + (west - x) * scale, width / 2 + (east - x) * scale,
                height / 2 - (north - y) * scale, height / 2 - (south - y) * scale]
    found = [columns.min(), columns.max() + 1, rows.min(), rows.max() + 1]
    assert found == pytest.approx(expected, abs=1.6)


def wait_for_pixels(page, colour, least=0.01):
    """The map, once a colour has more than a share `least` of it."""
    for _ in range(100):
        image = pixels(page, '#map')
        if share(image, colour) > least:
            return image
        page.wait_for_function('before => document.querySelector("#map").dataset.drawn != before',
                               arg=page.get_attribute('#map', 'data-drawn'))
    raise AssertionError(f'{colour} is not on the map')


def test_without_tiles_nothing_is_asked_for(tab, serve, run):
    page, asked = tab(viewport=DESK), []
    page.on('request', lambda request: asked.append(request.url))
    chromium.open_page(page, serve(run.add(ORIGIN).snapshots).address)
    assert [url for url in asked if '/tiles/' in url] == []


@pytest.mark.parametrize(('speedup', 'words'), [(1.0, 'silent for 0:20'),
                                                (8.0, 'silent for 2:40')])
def test_ages_are_in_the_time_of_the_run(shown, speedup, words):
    page = shown(Run(speedup).add(*FIRST).add(*LATER[1:]), DESK)
    chromium.wait(page, '#uavs', words)
    assert (f'at {speedup:g} × real time' in text(page, 'header')) == (speedup != 1.0)


class TileServer(BaseHTTPRequestHandler):
    """Any tile of another server: green; keeps the path and the referrer of each request."""

    asked: ClassVar[list] = []

    def do_GET(self):
        self.asked.append((self.path, self.headers.get('Referer')))
        png = io.BytesIO()
        matplotlib.image.imsave(png, GREEN, format='png')
        self.send_response(200)
        self.send_header('Content-Type', 'image/png')
        self.end_headers()
        self.wfile.write(png.getvalue())

    def log_message(self, *_):
        pass


def test_tiles_of_another_server_are_loaded_by_the_browser(shown, run):
    with ThreadingHTTPServer(('127.0.0.1', 0), TileServer) as other:
        threading.Thread(target=other.serve_forever, daemon=True).start()
        place = f'http://127.0.0.1:{other.server_port}'
        page = shown(run.add(ORIGIN), DESK, tile_source(place + '/t/{z}/{x}/{y}.png?key=1'))
        wait_for_pixels(page, UNDER_THE_VEIL, least=0.5)  # tiles come one by one
        other.shutdown()
    path, referrer = TileServer.asked[0]
    assert re.fullmatch(r'/t/[0-9]+/[0-9]+/[0-9]+\.png\?key=1', path)
    assert referrer.startswith('http://127.0.0.1:')  # tile servers refuse requests without


@pytest.mark.parametrize('speedup', [1.0, 8.0])
def test_arrivals_are_in_the_time_of_the_run(shown, speedup):
    line = {'kind': 'run', 'wall': BEGIN, 'speedup': speedup}
    run = Run(speedup).add(line, *FIRST)
    run.add(*(state(BEGIN + 0.5, uav, (0.0, 0.0)) for uav in ('u1', 'u2')))  # half a wall second
    page = shown(run, DESK)
    left = 10.0 - 0.5 * speedup
    chromium.wait(page, '#uavs details:nth-child(2)', f'next t3 0:{math.floor(left + 0.5):02}')


def test_the_strips_of_an_area_are_drawn_as_flown_and_as_still_to_fly(shown):
    corners = [[0.0, 0.0, 40.0], [200.0, 0.0, 40.0], [200.0, 120.0, 40.0], [0.0, 120.0, 40.0]]
    ways = {f'field#{k}': [[0.0, 60.0 * k - 30.0, 40.0], [200.0, 60.0 * k - 30.0, 40.0]]
            for k in (1, 2)}

    def rows(*names):
        line = listed(BEGIN, 'u1', 1, names)
        return {**line, 'tasks': [{**row, 'way': ways[row['id']]} for row in line['tasks']]}

    def reported(first):
        states = {'field': 'ASSIGNED', 'field#1': first, 'field#2': 'ASSIGNED'}
        return {'kind': 'statuses', 'wall': BEGIN, 'statuses': [
            {'task': name, 'state': each, 'uav': 'u1', 'reason': '', 'done': 1, 'pieces': 2}
            for name, each in states.items()]}

    field = {'id': 'field', 'position': corners[0], 'work': 'AREA', 'path': corners, 'holes': []}
    page = shown(Run().add(
        {'kind': 'announcement', 'wall': BEGIN, 'action': 'ADD', 'tasks': [field]},
        rows(*ways), reported('ACTIVE')).add(
        rows('field#2'), reported('COMPLETED'),
        state(BEGIN, 'u1', (100.0, 90.0), active='field#2')), DESK)
    assert find(page, 'field', '1 of 2 pieces of field are flown; u1 flies the rest.')
    page.click('#uavs details summary')
    chromium.wait(page, '#uavs details', '1 done, 1 to fly')
    x, y, scale = map(float, page.get_attribute('#map', 'data-view').split())
    image = pixels(page, '#map')
    height, width = image.shape[:2]

    def at(east, north):
        """Colours around a point of the map."""
        column, row = width / 2 + (east - x) * scale, height / 2 - (north - y) * scale
        return image[int(row) - 4:int(row) + 5, int(column) - 4:int(column) + 5]

    assert near(at(150.0, 90.0), BLUE).any()  # the rest of the second strip
    assert not near(at(50.0, 90.0), BLUE).any()  # what is flown of it
    flown = at(100.0, 30.0)
    assert not near(flown, BLUE).any()
    assert flown[4, 4].max() < at(100.0, 50.0).max() - 0.1  # a grey band
