# SPDX-License-Identifier: Apache-2.0
"""The server over real sockets on loopback."""
import http.client
import json
import socket

import pytest
from small_run import BEGIN

from uav_task_alloc.live.server import MOST_PAGES, PAGE, Server, name_of
from uav_task_alloc.live.snapshot_store import SnapshotStore

PATHS = [*PAGE, '/plotly.js', '/stream', '/at']


def ask(server, method, path, **headers):
    link = http.client.HTTPConnection('127.0.0.1', server.port, timeout=10)
    link.request(method, path, headers=headers)
    answer = link.getresponse()
    body = b'' if path == '/stream' and answer.status == 200 else answer.read()
    link.close()
    return answer, body


@pytest.mark.parametrize('path', [*PAGE, '/plotly.js', '/at?wall=1800000010'])
def test_the_page_and_its_files_are_there(run, serve, path):
    answer, body = ask(serve(run.board), 'GET', path)
    assert answer.status == 200
    assert len(body) > 100
    assert "default-src 'none'; script-src 'self';" in answer.headers['Content-Security-Policy']


def test_nothing_can_be_commanded(run, serve):
    server, before = serve(run.board), run.board.news(0)
    for method in ('POST', 'PUT', 'DELETE', 'PATCH', 'OPTIONS'):
        for path in [*PATHS, '/no/such']:
            answer, _ = ask(server, method, path)
            assert (answer.status, answer.headers['Allow']) == (405, 'GET,HEAD'), (method, path)
    assert run.board.news(0) == before


def test_no_file_but_those_of_the_page_is_given(run, serve):
    server = serve(run.board)
    for path in ('/index.html', '/../server.py', '/%2e%2e/server.py', '/page/live.js'):
        assert ask(server, 'GET', path)[0].status == 404


@pytest.mark.parametrize('host', ['evil.example', 'evil.example:8088', 'localhost.evil.example',
                                  '192.0.2.1:8088', '127.0.0.1.evil.example', ''])
def test_a_foreign_name_that_points_here_is_refused(run, serve, host):
    answer, body = ask(serve(run.board), 'GET', '/at?wall=1800000010', Host=host)
    assert (answer.status, b'expected 127.0.0.1' in body) == (403, True)


@pytest.mark.parametrize('host', ['localhost', 'LOCALHOST:9', '127.0.0.1', '[::1]:8088'])
def test_the_names_of_loopback_are_served(run, serve, host):
    assert ask(serve(run.board), 'GET', '/', Host=host)[0].status == 200


def test_on_a_network_addresses_and_the_name_of_this_machine_are_served(run, serve):
    server = serve(run.board, host='0.0.0.0')
    for host, status in (('192.0.2.1:8088', 200), (socket.gethostname(), 200),
                         ('evil.example', 403)):
        assert ask(server, 'GET', '/', Host=host)[0].status == status


def test_the_name_in_a_host_header():
    assert [name_of(host) for host in ('a:1', 'a', '[::1]:8', '[::1]', '')] == [
        'a', 'a', '::1', '::1', '']


def test_a_port_in_use_is_an_error_at_once(run, serve):
    with pytest.raises(OSError, match='in use'):
        Server(SnapshotStore(), '127.0.0.1', serve(run.board).port)


def test_a_moment_that_is_no_number_is_refused(run, serve):
    server = serve(run.board)
    for query in ('', '?wall=soon', '?wall=nan'):
        answer, body = ask(server, 'GET', '/at' + query)
        assert (answer.status, b'expected unix seconds' in body) == (400, True)


def test_the_stream_tells_everything_then_what_is_new(run, serve):
    server = serve(run.board)
    link = http.client.HTTPConnection('127.0.0.1', server.port, timeout=10)
    link.request('GET', '/stream')
    answer = link.getresponse()

    def message():
        for line in answer:
            if line.startswith(b'data: '):
                return json.loads(line[6:])

    assert message()['all'] is True
    run.board.put(BEGIN + 30, {}, {'zones': []})
    got = message()
    while not got['parts']:
        got = message()
    assert (got['all'], got['parts']) == (False, {'zones': []})
    link.close()


def test_more_pages_than_the_limit_are_told_so(run, serve):
    server = serve(run.board)
    server.pages = MOST_PAGES
    assert ask(server, 'GET', '/stream')[0].status == 503


def test_a_stopped_server_gives_its_port_back(run, serve):
    server = serve(run.board)
    server.stop()
    assert not server.thread.is_alive()
    again = serve(run.board, server.port)
    assert ask(again, 'GET', '/')[0].status == 200
