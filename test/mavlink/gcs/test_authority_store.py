# SPDX-License-Identifier: Apache-2.0
"""Who has each aircraft, on disk: whole or not at all, and no failure ends the bridge."""
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
from uav_task_alloc.mavlink.gcs import authority_store
from uav_task_alloc.mavlink.gcs.authority import AuthorityRecord, AuthorityState
from uav_task_alloc.mavlink.gcs.authority_store import AuthorityFileStore, boot_id, uav_file_name

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
def said():
    return []


@pytest.fixture
def store(tmp_path, said):
    return AuthorityFileStore(str(tmp_path / 'new' / 'folder'), said.append, 'boot')


@pytest.mark.parametrize(
    'record', [AuthorityRecord(), FULL, AuthorityRecord(AuthorityState.LOST, 'ä "quoted" text')]
)
def test_what_was_saved_is_loaded_after_a_restart(store, tmp_path, said, record):
    store.save('uav_1', record)
    again = AuthorityFileStore(str(tmp_path / 'new' / 'folder'), said.append, 'boot')
    assert again.load('uav_1') == record
    assert again.load('uav_2') is None
    assert said == []


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


def test_after_a_restart_of_the_computer_a_swap_is_long_ago(store, tmp_path, said):
    store.save('uav_1', FULL)
    other = AuthorityFileStore(str(tmp_path / 'new' / 'folder'), said.append, 'other boot')
    assert other.load('uav_1') == replace(FULL, since=0.0, swap_at=authority_store.LONG_AGO)
    assert boot_id() == boot_id()


@pytest.mark.parametrize('moment', ['fsync', 'replace'])
def test_a_bridge_that_ends_amid_a_write_leaves_the_old_content(store, said, monkeypatch, moment):
    store.save('uav_1', FULL)

    def end(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, moment, end)
    with pytest.raises(KeyboardInterrupt):
        store.save('uav_1', AuthorityRecord(AuthorityState.LOST))
    monkeypatch.undo()
    assert store.load('uav_1') == FULL
    assert said == []


def test_a_killed_bridge_leaves_a_whole_file_at_every_moment(tmp_path, said):
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
        found = AuthorityFileStore(str(tmp_path), said.append).load('uav_1')
        assert found.mode in (last, last + 1)
        assert found.why == 'x' * (found.mode % 7 * 1000)
    assert said == []


def full_disk(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_is_reported_once_and_leaves_no_file_that_is_out_of_date(
        store, said, monkeypatch):
    store.save('uav_1', FULL)
    monkeypatch.setattr(os, 'replace', full_disk)
    for k in range(3):
        store.save('uav_1', replace(FULL, since=float(k)))
        store.save('uav_2', FULL)
    assert len(said) == 1
    assert 'authority_uav_1.json: not written: [Errno 28] No space left on device' in said[0]
    assert 'after a restart of the bridge an airborne vehicle is left to its pilot' in said[0]
    assert list(store.path('x').parent.iterdir()) == []
    monkeypatch.undo()
    store.retry()
    assert (store.load('uav_1').since, store.load('uav_2')) == (2.0, FULL)
    assert said[1:] == [f'{store.path("x").parent}: written again']
    store.retry()
    monkeypatch.setattr(os, 'replace', full_disk)
    store.save('uav_1', AuthorityRecord(AuthorityState.LOST))
    assert len(said) == 3


def test_a_folder_that_cannot_be_written_to_any_more_is_reported_with_what_stays_there(
        store, said, monkeypatch):
    store.save('uav_1', FULL)

    def read_only(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(os, 'replace', read_only)
    monkeypatch.setattr(type(store.path('x')), 'unlink', read_only)
    store.save('uav_1', AuthorityRecord(AuthorityState.LOST))
    assert len(said) == 1
    assert 'what it holds is out of date, and it cannot be removed' in said[0]


def test_one_file_that_cannot_be_written_does_not_hinder_the_others(store, said):
    store.path('uav_1').mkdir()
    store.save('uav_1', FULL)
    store.save('uav_2', FULL)
    assert store.load('uav_2') == FULL
    assert len(said) == 1


def test_a_folder_that_is_removed_meanwhile_ends_nothing(store, said):
    store.path('x').parent.rmdir()
    store.save('uav_1', FULL)
    assert store.load('uav_1') is None
    assert len(said) == 1


def test_a_folder_that_cannot_be_created_is_refused_at_the_start(tmp_path, said):
    (tmp_path / 'file').write_text('')
    for folder in (tmp_path / 'file', tmp_path / 'file' / 'below'):
        with pytest.raises(InvalidValue, match=r'state_dir = .*expected a folder that can be w'):
            AuthorityFileStore(str(folder), said.append)


def changed(change):
    """A file whose content is another."""
    def make(path):
        body = json.loads(path.read_text())
        change(body)
        path.write_text(json.dumps(body))
    return make


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
def test_a_file_that_cannot_be_used_is_reported_and_not_believed(store, said, damage, words):
    store.save('uav_1', FULL)
    damage(store.path('uav_1'))
    assert store.load('uav_1') is None
    assert len(said) == 1
    assert re.search(words, said[0])
    assert said[0].startswith(str(store.path('uav_1')))
    assert said[0].endswith('an airborne uav_1 is left to its pilot, unless it flies our mission')


def test_whatever_a_file_holds_load_returns_a_record_or_none(store, said):
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
        found = store.load('uav_1')
        if found is not None:
            assert isinstance(found.state, AuthorityState)
            assert all(
                isinstance(
                    getattr(found, spec.name),
                    (bool, int, float, str, tuple, AuthorityState, type(None)),
                )
                for spec in fields(found)
            )
