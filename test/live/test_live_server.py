# SPDX-License-Identifier: Apache-2.0
"""The server over real sockets on loopback."""
import http.client
import json
import socket

import pytest
from small_run import BEGIN

from uav_task_alloc.live.server import MAX_STREAMS, PAGE_FILES, PageServer, host_name
from uav_task_alloc.live.snapshot_store import SnapshotStore

PATHS = [*PAGE_FILES, '/tiles.json', '/tiles/1/0/0', '/stream', '/at']


def request(server, method, path, **headers):
    connection = http.client.HTTPConnection('127.0.0.1', server.port, timeout=60)
    connection.request(method, path, headers=headers)
    response = connection.getresponse()
    body = b'' if path == '/stream' and response.status == 200 else response.read()
    connection.close()
    return response, body


@pytest.mark.parametrize('path', [*PAGE_FILES, '/at?wall=1800000010'])
def test_the_page_and_its_files_are_served(run, serve, path):
    response, body = request(serve(run.snapshots), 'GET', path)
    assert response.status == 200
    assert len(body) > 100
    assert "default-src 'none'; script-src 'self';" in response.headers['Content-Security-Policy']


def test_nothing_can_be_commanded(run, serve):
    server, before = serve(run.snapshots), run.snapshots.updates_since(0)
    for method in ('POST', 'PUT', 'DELETE', 'PATCH', 'OPTIONS'):
        for path in [*PATHS, '/no/such']:
            response, _ = request(server, method, path)
            assert response.status == 405, (method, path)
            assert response.headers['Allow'] == 'GET,HEAD'
    assert run.snapshots.updates_since(0) == before


def test_only_the_files_of_the_page_are_served(run, serve):
    server = serve(run.snapshots)
    for path in ('/index.html', '/../server.py', '/%2e%2e/server.py', '/page/live.js'):
        assert request(server, 'GET', path)[0].status == 404


@pytest.mark.parametrize('host', ['evil.example', 'evil.example:8088', 'localhost.evil.example',
                                  '192.0.2.1:8088', '127.0.0.1.evil.example', ''])
def test_a_foreign_name_that_points_here_is_refused(run, serve, host):
    response, body = request(serve(run.snapshots), 'GET', '/at?wall=1800000010', Host=host)
    assert (response.status, b'expected 127.0.0.1' in body) == (403, True)


@pytest.mark.parametrize('host', ['localhost', 'LOCALHOST:9', '127.0.0.1', '[::1]:8088'])
def test_the_names_of_loopback_are_served(run, serve, host):
    assert request(serve(run.snapshots), 'GET', '/', Host=host)[0].status == 200


def test_on_a_network_addresses_and_the_name_of_this_machine_are_served(run, serve):
    server = serve(run.snapshots, host='0.0.0.0')
    for host, status in (('192.0.2.1:8088', 200), (socket.gethostname(), 200),
                         ('evil.example', 403)):
        assert request(server, 'GET', '/', Host=host)[0].status == status


def test_the_name_in_a_host_header():
    assert [host_name(host) for host in ('a:1', 'a', '[::1]:8', '[::1]', '')] == [
        'a', 'a', '::1', '::1', '']


def test_a_port_in_use_is_an_error_at_once(run, serve):
    with pytest.raises(OSError, match='in use'):
        PageServer(SnapshotStore(), '127.0.0.1', serve(run.snapshots).port)


def test_a_moment_that_is_no_number_is_refused(run, serve):
    server = serve(run.snapshots)
    for query in ('', '?wall=soon', '?wall=nan'):
        response, body = request(server, 'GET', '/at' + query)
        assert (response.status, b'expected unix seconds' in body) == (400, True)


def test_the_stream_sends_everything_then_the_changes(run, serve):
    server = serve(run.snapshots)
    connection = http.client.HTTPConnection('127.0.0.1', server.port, timeout=60)
    connection.request('GET', '/stream')
    response = connection.getresponse()

    def message():
        for line in response:
            if line.startswith(b'data: '):
                return json.loads(line[6:])

    assert message()['all'] is True
    run.snapshots.put(BEGIN + 30, {}, {'zones': []})
    update = message()
    while not update['parts']:
        update = message()
    assert (update['all'], update['parts']) == (False, {'zones': []})
    connection.close()


def test_more_pages_than_the_limit_are_refused(run, serve):
    server = serve(run.snapshots)
    server.streams = MAX_STREAMS
    assert request(server, 'GET', '/stream')[0].status == 503


@pytest.mark.skipif(not hasattr(socket, 'TCP_USER_TIMEOUT'), reason='Linux only')
def test_a_page_that_vanishes_from_the_network_frees_its_stream(run, serve):
    """A tablet whose radio drops would hold one of the streams for a quarter of an hour."""
    server = serve(run.snapshots)
    assert server.socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 20_000


def test_a_stopped_server_releases_its_port(run, serve):
    server = serve(run.snapshots)
    server.stop()
    assert not server.thread.is_alive()
    restarted = serve(run.snapshots, server.port)
    assert request(restarted, 'GET', '/')[0].status == 200
