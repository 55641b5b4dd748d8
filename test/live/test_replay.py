# SPDX-License-Identifier: Apache-2.0
import json
import signal
import subprocess
import sys

import pytest
from small_run import BEGIN, FIRST, LATER

from uav_task_alloc.live.__main__ import main, play
from uav_task_alloc.record.record_file import RECORD_FILE


@pytest.fixture
def folder(tmp_path):
    (tmp_path / RECORD_FILE).write_text(''.join(json.dumps(line) + '\n' for line in FIRST + LATER))
    return tmp_path


def test_a_record_is_shown_at_its_end_and_at_a_moment(folder):
    snapshots = play(folder)
    now = json.loads(snapshots.updates_since(0)[1])
    then = json.loads(snapshots.at(BEGIN + 19))['parts']
    assert now['parts']['statuses']['t5'] == ['UNASSIGNED', '', 'inside zone z1']
    assert [plan['revision'] for plan in now['plans']] == [1, 2]
    assert now['clock'] == {'start': BEGIN, 'speedup': 1.0, 'rate': 1.0, 'live': False,
                            'wall': BEGIN + 20, 'begin': BEGIN}
    assert then['statuses']['t1'] == ['ACTIVE', 'u1', '']


def test_a_record_is_shown_until_a_moment(folder):
    assert json.loads(play(folder, until=10.0).updates_since(0)[1])['clock']['wall'] == BEGIN


def test_a_folder_without_record_is_an_error(tmp_path):
    with pytest.raises(OSError, match=RECORD_FILE):
        play(tmp_path)


@pytest.mark.parametrize(('text', 'expected'), [
    ('', 'expected a record with a line at least'), ('no json\n', 'expected a record (JSON'),
    ('{"wall": 1.0}\n', 'expected a record (KeyError'), ('[]\n', 'expected a record (TypeError'),
    ('{"wall": 1.0, "kind": "toast"}\n', 'expected a record (AttributeError')])
def test_a_file_that_is_no_record_ends_with_one_line(tmp_path, text, expected):
    (tmp_path / RECORD_FILE).write_text(text)
    with pytest.raises(SystemExit) as end:
        main([str(tmp_path)])
    assert f"file = '{tmp_path / RECORD_FILE}': {expected}" in str(end.value)
    assert '\n' not in str(end.value)


@pytest.mark.parametrize(('arguments', 'expected'), [
    (['/no/such'], '/no/such/record.jsonl: No such file or directory'),
    (['FOLDER', '--tiles', '/no/tiles'], "tiles = '/no/tiles': expected a folder"),
    (['FOLDER', '--host', '192.0.2.1'], '--host 192.0.2.1 --port 0: ')])
def test_what_cannot_be_served_ends_with_one_line(folder, arguments, expected):
    with pytest.raises(SystemExit) as end:
        main([str(folder) if name == 'FOLDER' else name for name in arguments])
    assert str(end.value).startswith(expected)


@pytest.mark.parametrize('port', ['x', '65536', '-1', '١'])
def test_a_port_that_is_none_is_refused_without_a_list_of_all(port, folder, capsys):
    with pytest.raises(SystemExit, match='2'):
        main([str(folder), f'--port={port}'])
    assert capsys.readouterr().err.endswith(
        f'argument --port: {port!r}: expected a whole number in [0, 65535]\n')


def test_a_replay_without_aiohttp_says_what_to_install(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, 'aiohttp', None)
    monkeypatch.delitem(sys.modules, 'uav_task_alloc.live.server', raising=False)
    with pytest.raises(SystemExit, match=r'uav_task_alloc\[view\]'):
        main([str(folder)])


def test_a_replay_serves_until_ctrl_c(folder):
    with subprocess.Popen([sys.executable, '-m', 'uav_task_alloc.live', str(folder)], text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        assert process.stdout.readline().startswith(f'Page of {folder}: http://127.0.0.1:')
        process.send_signal(signal.SIGINT)
        try:
            assert (process.wait(90), process.stdout.read()) == (130, '')
        finally:
            process.kill()  # where it has not ended, leaving `with` would wait for it
