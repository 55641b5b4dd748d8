# SPDX-License-Identifier: Apache-2.0
"""The authority records on disk: replaced atomically, and no failure ends the bridge."""
import errno
import json
import os
import random
import re
import signal
import subprocess
import sys
from dataclasses import fields, replace

import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.gcs.authority_state import (
    UNUSABLE,
    AuthorityRecord,
    AuthorityState,
    TaskMark,
)
from uav_task_alloc.mavlink.gcs.authority_store import (
    LONG_AGO,
    AuthorityFileStore,
    boot_id,
    uav_file_name,
)

FULL = AuthorityRecord(
    AuthorityState.HELD,
    'takeoff is true',
    12.5,
    False,
    True,
    False,
    True,
    65536,
    True,
    (4, 10),
    False,
    99.0,
)
WRITER = """
import sys
from itertools import count
from uav_task_alloc.mavlink.gcs.authority import AuthorityRecord, AuthorityState
from uav_task_alloc.mavlink.gcs.authority_store import AuthorityFileStore
store = AuthorityFileStore(sys.argv[1], print)
for k in count():
    store.save('uav_1', AuthorityRecord(
        AuthorityState.HELD, 'x' * (k % 7 * 1000), float(k), mode=k))
    print(k, flush=True)
"""


@pytest.fixture
def reports():
    return []


@pytest.fixture
def store(tmp_path, reports):
    return AuthorityFileStore(str(tmp_path / 'new' / 'folder'), reports.append, 'boot')


@pytest.mark.parametrize(
    'record', [AuthorityRecord(), FULL, AuthorityRecord(AuthorityState.LOST, 'ä "quoted" text'),
               AuthorityRecord(ahead=(TaskMark('t1', 1.5, -2.25, 50.0, 0.0, False),))]
)
def test_what_was_saved_is_loaded_after_a_restart(store, tmp_path, reports, record):
    store.save('uav_1', record)
    restarted = AuthorityFileStore(str(tmp_path / 'new' / 'folder'), reports.append, 'boot')
    assert restarted.load('uav_1') == record
    assert restarted.load('uav_2') is None
    assert reports == []


@pytest.mark.parametrize('names', [
    ('a/b', 'a_b', 'a%2Fb'), ('fleet/uav_1', 'uav_1'), ('../x', 'x'), ('n' * 200, 'n' * 199),
    ('/'.join('n' * 100), '/'.join('n' * 99)), ('A', 'a')])
def test_each_uav_has_a_file_of_its_own_inside_the_folder(store, names):
    for k, name in enumerate(names):
        store.save(name, replace(FULL, since=float(k)))
    assert [store.load(name).since for name in names] == [float(k) for k in range(len(names))]
    assert len({uav_file_name(name) for name in names}) == len(names)
    assert {store.path(name).parent for name in names} == {store.path('x').parent}
    assert all(len(uav_file_name(name)) < 255 for name in names)


def test_nothing_but_the_files_of_the_uavs_is_left_in_the_folder(store):
    for k in range(3):
        store.save('uav_1', replace(FULL, since=float(k)))
    assert [path.name for path in store.path('x').parent.iterdir()] == ['authority_uav_1.json']


def test_after_a_restart_of_the_computer_a_replacement_is_long_ago(store, tmp_path, reports):
    store.save('uav_1', FULL)
    other = AuthorityFileStore(str(tmp_path / 'new' / 'folder'), reports.append, 'other boot')
    assert other.load('uav_1') == replace(FULL, since=0.0, replacing_since=LONG_AGO)
    assert boot_id() == boot_id()


@pytest.mark.parametrize('moment', ['fsync', 'replace'])
def test_a_bridge_that_ends_during_a_write_leaves_the_old_content(
        store, reports, monkeypatch, moment):
    store.save('uav_1', FULL)

    def end(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, moment, end)
    with pytest.raises(KeyboardInterrupt):
        store.save('uav_1', AuthorityRecord(AuthorityState.LOST))
    monkeypatch.undo()
    assert store.load('uav_1') == FULL
    assert reports == []


def test_a_killed_bridge_leaves_a_complete_file_at_any_time(tmp_path, reports):
    for _ in range(5):
        writer = subprocess.Popen([sys.executable, '-c', WRITER, str(tmp_path)],
                                  stdout=subprocess.PIPE, text=True,
                                  env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
        last = 0
        with writer.stdout:
            for line in writer.stdout:
                last = int(line)
                if last == 20:
                    writer.send_signal(signal.SIGKILL)
        writer.wait()
        record = AuthorityFileStore(str(tmp_path), reports.append).load('uav_1')
        assert record.mode in (last, last + 1)
        assert record.why == 'x' * (record.mode % 7 * 1000)
    assert reports == []


def full_disk(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_is_reported_once_and_leaves_an_empty_file(
        store, reports, monkeypatch):
    store.save('uav_1', FULL)
    monkeypatch.setattr(os, 'replace', full_disk)
    for k in range(3):
        store.save('uav_1', replace(FULL, since=float(k)))
        store.save('uav_2', FULL)
    assert len(reports) == 1
    assert 'authority_uav_1.json: not written: [Errno 28] No space left on device' in reports[0]
    assert 'after a restart of the bridge an airborne vehicle is left to its pilot' in reports[0]
    assert [store.path(uav).read_text() for uav in ('uav_1', 'uav_2')] == ['', '']
    assert AuthorityFileStore(str(store.path('x').parent), [].append).load('uav_2') is UNUSABLE
    monkeypatch.undo()
    store.retry()
    assert (store.load('uav_1').since, store.load('uav_2')) == (2.0, FULL)
    assert reports[1:] == [f'{store.path("x").parent}: written again']
    store.retry()
    monkeypatch.setattr(os, 'replace', full_disk)
    store.save('uav_1', AuthorityRecord(AuthorityState.LOST))
    assert len(reports) == 3


def test_a_folder_that_becomes_read_only_is_reported_with_the_outdated_file(
        store, reports, monkeypatch):
    store.save('uav_1', FULL)

    def read_only(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(os, 'replace', read_only)
    monkeypatch.setattr(os, 'truncate', read_only)
    store.save('uav_1', AuthorityRecord(AuthorityState.LOST))
    assert len(reports) == 1
    assert 'what it holds is out of date, and it cannot be emptied' in reports[0]


def test_one_file_that_cannot_be_written_does_not_affect_the_others(store, reports):
    store.path('uav_1').mkdir()
    store.save('uav_1', FULL)
    store.save('uav_2', FULL)
    assert store.load('uav_2') == FULL
    assert len(reports) == 1


def test_a_folder_that_is_removed_at_run_time_is_reported(store, reports):
    store.path('x').parent.rmdir()
    store.save('uav_1', FULL)
    assert store.load('uav_1') is None
    assert len(reports) == 1


def test_a_folder_that_cannot_be_created_is_refused_at_the_start(tmp_path, reports):
    (tmp_path / 'file').write_text('')
    for folder in (tmp_path / 'file', tmp_path / 'file' / 'below'):
        with pytest.raises(InvalidValue, match=r'state_dir = .*expected a folder that can be w'):
            AuthorityFileStore(str(folder), reports.append)


def test_a_folder_is_of_one_bridge_until_that_ends(store, reports):
    other = AuthorityFileStore(str(store.path('x').parent), reports.append)
    other.close()  # it has no lock
    store.lock()
    with pytest.raises(InvalidValue, match=r'state_dir = .*another bridge that runs has this one'):
        other.lock()
    store.close()
    other.lock()
    other.close()
    assert not list(store.path('x').parent.iterdir())


def changed(change):
    """A function that changes the JSON body of a file."""
    def rewrite(path):
        body = json.loads(path.read_text())
        change(body)
        path.write_text(json.dumps(body))
    return rewrite


def set_field(name, value):
    return changed(lambda body: body['record'].update({name: value}))


@pytest.mark.parametrize(('damage', 'words'), [
    (lambda path: path.write_text(''), 'Expecting value'),
    (lambda path: path.write_bytes(path.read_bytes()[:-20]), 'line 2'),
    (lambda path: path.write_bytes(b'\xff\xfe' * 9), 'utf-8'),
    (lambda path: path.write_text('[' * 60000), 'recursion'),
    (lambda path: path.write_text('x' * 99999), 'larger than 65536 bytes'),
    (lambda path: path.write_text('{"format": 1}'), 'corrupt or not an authority record'),
    (lambda path: (path.unlink(), path.mkdir()), 'no regular file|Is a directory'),
    (lambda path: (path.unlink(), os.mkfifo(path)), 'no regular file'),
    (changed(lambda body: body.update(format=2)), 'format = 2: expected 1'),
    (changed(lambda body: body.update(uav_id='uav_9')), "uav_id = 'uav_9': expected 'uav_1'"),
    (changed(lambda body: body['record'].pop('killed')), 'record: expected state, why, since'),
    (changed(lambda body: body['record'].update(extra=1)), 'record: expected state, why, since'),
    (set_field('state', 'MINE'), "state = 'MINE': expected another type of value"),
    (set_field('state', 'UNKNOWN'), 'expected another'), (set_field('state', 2), 'state = 2'),
    (set_field('killed', 0), 'killed = 0'), (set_field('mode', 1.5), 'mode = 1.5'),
    (set_field('since', float('nan')), 'since = nan'), (set_field('since', True), 'since = True'),
    (set_field('swap_at', 10**400), 'swap_at = 1000'), (set_field('why', '\ud800'), 'why = '),
    (set_field('commanded', [1, None]), 'commanded = '), (set_field('mode', -1), 'mode = -1'),
])
def test_a_file_that_cannot_be_used_is_reported_and_ignored(store, reports, damage, words):
    store.save('uav_1', FULL)
    damage(store.path('uav_1'))
    assert store.load('uav_1') is UNUSABLE
    assert len(reports) == 1
    assert re.search(words, reports[0])
    assert reports[0].startswith(str(store.path('uav_1')))
    assert reports[0].endswith('an airborne uav_1 is left to its pilot unless it flies our '
                               'mission, and on the ground it waits for ~/hand_over')


def test_load_returns_a_record_or_none_for_any_content(store, reports):
    store.save('uav_1', FULL)
    path, rng = store.path('uav_1'), random.Random(11)
    good = path.read_bytes()
    for _ in range(3000):
        data = bytearray(good)
        for _ in range(rng.randrange(1, 6)):
            at = rng.randrange(len(data))
            data[at:at + rng.randrange(4)] = rng.choice(
                (rng.randbytes(2), b'"', b'}', b'null', b'1e999', b'[', b'true', b''))
        path.write_bytes(data)
        record = store.load('uav_1')
        if record is not None:
            assert isinstance(record.state, AuthorityState)
            assert all(
                isinstance(
                    getattr(record, spec.name),
                    (bool, int, float, str, tuple, AuthorityState, type(None)),
                )
                for spec in fields(record)
            )
