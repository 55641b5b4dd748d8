# SPDX-License-Identifier: Apache-2.0
"""Map tiles of the live page: the parameter, the server, and what it refuses."""
import pytest
from test_live_server import request

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.live.tiles import MAX_ZOOM, tile_source

PNG, JPEG = b'\x89PNG tile', b'\xff\xd8\xff tile'
URL = 'https://tile.example/{z}/{x}/{y}.png?key=1'


@pytest.fixture
def folder(tmp_path):
    for name, content in (('14/8580/5735.png', PNG), ('16/3/4.jpg', JPEG)):
        path = tmp_path / 'tiles' / name
        path.parent.mkdir(parents=True)
        path.write_bytes(content)
    (tmp_path / 'secret.png').write_bytes(b'secret')
    (tmp_path / 'tiles/5').mkdir()
    (tmp_path / 'tiles/5/5').mkdir()
    (tmp_path / 'tiles/5/5/5.png').symlink_to(tmp_path / 'secret.png')
    return tmp_path / 'tiles'


@pytest.fixture
def server(run, serve, folder):
    server = serve(run.snapshots)
    server.tiles = tile_source(str(folder), 'whose')
    return server


def test_the_tiles_of_a_folder_are_served(server):
    response, body = request(server, 'GET', '/tiles/14/8580/5735')
    assert (response.status, body, response.headers['Content-Type']) == (200, PNG, 'image/png')
    response, body = request(server, 'GET', '/tiles/16/3/4')
    assert (body, response.headers['Content-Type']) == (JPEG, 'image/jpeg')
    assert request(server, 'GET', '/tiles.json')[1] == (
        b'{"url": "tiles/{z}/{x}/{y}", "attribution": "whose", "min_zoom": 5, "max_zoom": 16}')


def test_a_missing_tile_is_no_error(server):
    assert request(server, 'GET', '/tiles/14/1/1')[0].status == 204


@pytest.mark.parametrize('path', [
    '/tiles/../secret', '/tiles/14/../../secret', '/tiles/14/8580/..%2f..%2f..%2fsecret',
    '/tiles/14/%2e%2e/%2e%2e', '/tiles/14/8580/5735.png', '/tiles/-1/0/0', '/tiles/5/5/5',
    '/tiles/999/0/0', '/tiles//etc/passwd', '/tiles/%D9%A5/5/5'])
def test_nothing_outside_of_the_folder_is_served(server, path):
    response, body = request(server, 'GET', path)
    assert (response.status in (204, 404), b'secret' in body) == (True, False)


def test_without_the_parameter_there_are_none(run, serve):
    server = serve(run.snapshots)
    assert tile_source('') is None
    assert request(server, 'GET', '/tiles.json')[1] == b'null'
    assert request(server, 'GET', '/tiles/14/8580/5735')[0].status == 204
    policy = request(server, 'GET', '/')[0].headers['Content-Security-Policy']
    assert "img-src 'self' data: ;" in policy


def test_the_browser_may_load_tiles_from_the_server_of_the_parameter_only(run, serve):
    server = serve(run.snapshots)
    server.tiles = tile_source(URL)
    policy = request(server, 'GET', '/')[0].headers['Content-Security-Policy']
    assert "img-src 'self' data: https://tile.example;" in policy
    assert server.tiles.file(14, 8580, 5735) is None


def test_levels_beyond_the_limit_are_not_asked_for(tmp_path):
    (tmp_path / '99').mkdir()
    assert tile_source(str(tmp_path)).max_zoom == MAX_ZOOM


@pytest.mark.parametrize('place', [
    '/no/such/folder', 'ftp://tile.example/{z}/{x}/{y}.png', 'https://tile.example/{z}/{x}.png',
    'https:///{z}/{x}/{y}', "https://a;script-src 'unsafe-inline'/{z}/{x}/{y}",
    'https://[/{z}{x}{y}'])
def test_a_place_that_is_neither_folder_nor_template_is_refused(place):
    with pytest.raises(InvalidValue, match=r'tiles = .*expected a folder with \{z\}/\{x\}/\{y\}'):
        tile_source(place)


def test_a_folder_without_tiles_is_refused(tmp_path):
    with pytest.raises(InvalidValue, match='expected a folder with'):
        tile_source(str(tmp_path))
