# SPDX-License-Identifier: Apache-2.0
"""The output folder of a demo: its own files are removed, others never."""
import re

import pytest

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.mavlink.gcs.authority_state import AuthorityRecord, AuthorityState
from uav_task_alloc.mavlink.gcs.authority_store import AuthorityFileStore
from uav_task_alloc.mavlink.gcs.fence_store import FenceFileStore
from uav_task_alloc.mavlink.gcs.hold_store import HoldFileStore
from uav_task_alloc.record import run_folder

OWN = ('summary.json', 'map.png', 'record.jsonl', 'flight.jsonl', 'allocator.log',
       'state/journal.sqlite3', 'state/journal.sqlite3-wal', 'state/journal.sqlite3.damaged-1',
       'state/authority_uav_1.json')


def everything(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob('*'))


@pytest.fixture
def flown(tmp_path):
    """The output folder of a finished demo."""
    folder = tmp_path / 'parent' / 'out'
    run_folder.prepare(folder)
    for name in OWN:
        (folder / name).write_text('x')
    return folder


def test_finding_34_files_of_an_earlier_demo_are_removed(flown):
    run_folder.prepare(flown)
    assert everything(flown) == [run_folder.MARKER, 'state']


def test_whatever_a_bridge_has_stored_is_removed(flown):
    state = flown / run_folder.STATE
    AuthorityFileStore(str(state), print).save('uav_9', AuthorityRecord(
        AuthorityState.HELD, seen=(1.0, 2.0, 3.0, 4.0, 0.0, 0.0, 0.0)))
    HoldFileStore(str(state), print).save_hold('uav_9', 'wind')
    FenceFileStore(str(state), print).save_fence('uav_9', [(5001, 3.0, 1, 2)])
    (state / 'hold_uav_9.json.tmp').write_text('x')  # a bridge that was killed
    stored = {path.name for path in state.iterdir()} - {path.split('/')[-1] for path in OWN}
    assert stored == {'authority_uav_9.json', 'authority_uav_9.position', 'hold_uav_9.json',
                      'fence_uav_9.json', 'hold_uav_9.json.tmp'}
    run_folder.prepare(flown)
    assert everything(flown) == [run_folder.MARKER, 'state']


@pytest.mark.parametrize('name', ['notes.txt', 'state/notes.txt', 'flight.mcap', 'sub/map.png',
                                  '.git'])
def test_finding_34_one_foreign_file_keeps_all_of_them(flown, name):
    (flown / name).parent.mkdir(exist_ok=True)
    (flown / name).write_text('mine')
    before = everything(flown)
    with pytest.raises(InvalidValue, match=rf"out = '{flown}': expected only files of an earlier "
                                           rf"demo in it; others are {name.split('/map')[0]}"):
        run_folder.prepare(flown)
    assert everything(flown) == before


def test_finding_34_files_that_only_have_the_names_of_a_demo_are_kept(flown):
    (flown / run_folder.MARKER).unlink()
    before = everything(flown)
    with pytest.raises(InvalidValue, match=rf'it has no {re.escape(run_folder.MARKER)}, but '
                                           r'allocator\.log, flight\.jsonl'):
        run_folder.prepare(flown)
    assert everything(flown) == before


def test_the_folder_of_a_version_without_marker_is_identified_by_its_logs(flown):
    (flown / run_folder.MARKER).unlink()
    for name in run_folder.LOGS:
        (flown / name).write_text('x')
    run_folder.prepare(flown)
    assert everything(flown) == [run_folder.MARKER, 'state']


def test_finding_34_links_are_not_followed(flown, tmp_path):
    elsewhere = tmp_path / 'elsewhere'
    elsewhere.mkdir()
    (elsewhere / 'journal.sqlite3').write_text('of a fleet')
    for name in ('authority_uav_1.json', 'journal.sqlite3', 'journal.sqlite3-wal',
                 'journal.sqlite3.damaged-1'):
        (flown / 'state' / name).unlink()
    (flown / 'state').rmdir()
    (flown / 'state').symlink_to(elsewhere)
    with pytest.raises(InvalidValue, match='others are state'):
        run_folder.prepare(flown)
    assert everything(elsewhere) == ['journal.sqlite3']


def test_a_file_in_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / 'out').write_text('x')
    with pytest.raises(InvalidValue, match='expected a folder'):
        run_folder.prepare(tmp_path / 'out')
