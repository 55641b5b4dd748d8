# SPDX-License-Identifier: Apache-2.0
"""Damaged rows of a journal: only that row is lost and named; the start continues."""
import json
import math
import random
import sqlite3

import pytest
from allocation import AllocatorDriver

from uav_task_alloc.allocator.persistence.persistence import Persistence
from uav_task_alloc.allocator.persistence.restore import restored_state, task_row
from uav_task_alloc.allocator.records import TaskRecord
from uav_task_alloc.journal import FILE_NAME, Journal, JournalRow
from uav_task_alloc.model import Task, ThreatZone

HOSTILE = (None, True, -1, 0, 1.5, 10**400, 1e308, math.nan, math.inf, -math.inf, '', 'x', 'a b',
        '\ud800', [], [[]], {}, {'id': 'x'}, [1.0, 2.0, math.nan], [None] * 3)
ZONES = (ThreatZone.hemisphere('z1', (500.0, 900.0, 0.0), 100.0),
         ThreatZone.polygon('z2', ((0.0, 800.0), (9.0, 800.0), (9.0, 820.0)), -5.0, 70.0, 2.0))
BODIES = {'invalid UTF-8': b'{"a": "\xff"}', 'half an object': b'{"task": ', 'a number': 5,
          'nested too deep': '[' * 100_000, 'nothing': ''}


def filled(folder):
    """A journal with tasks t1, t2, t3, lists, zones and a UAV that is switched off."""
    persistence = Persistence(str(folder), print)
    driver = AllocatorDriver(persistence.saved)
    driver.uav('a', 0.0, 0.0, 50.0)
    driver.uav('b', 0.0, 500.0, 50.0)
    driver.world.set_zones(ZONES, (), driver.now)
    driver.add(('t1', 100, 0), ('t2', 1000, 0), ('t3', 100, 500))
    driver.settle()
    driver.event('COMPLETED', 't1', 'a')
    driver.world.set_available('b', False, driver.now)
    driver.settle()
    persistence.save(driver.core, driver.now)
    return persistence


@pytest.fixture
def rows(tmp_path):
    persistence = filled(tmp_path)
    held = persistence._journal.load()
    persistence.close()
    return held


def paths(body, path=()):
    """The path to every value of a JSON body."""
    yield path
    items = body.items() if isinstance(body, dict) else enumerate(body) if isinstance(
        body, list) else ()
    for key, value in items:
        yield from paths(value, (*path, key))


def with_value(body, path, value):
    if not path:
        return value
    copy = json.loads(json.dumps(body))
    place = copy
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return copy


@pytest.mark.parametrize('name', BODIES)
def test_finding_23_a_damaged_row_is_left_out_and_named_and_the_others_kept(tmp_path, name):
    filled(tmp_path).close()
    database = sqlite3.connect(tmp_path / FILE_NAME)
    body = BODIES[name]
    database.execute('UPDATE world SET body = ' + (
        'CAST(? AS TEXT)' if isinstance(body, bytes) else '?')
        + " WHERE kind = 'task' AND id = 't2'", (body,))
    database.commit()
    database.close()
    for _ in range(2):
        errors = []
        persistence = Persistence(str(tmp_path), errors.append)
        assert [record.task.id for record in persistence.saved.tasks][:2] == ['t1', 't3']
        assert 't2' not in AllocatorDriver(persistence.saved).world.tasks.records
        assert "1 left out: journal row task 't2' cannot be read" in persistence.error
        assert errors == [persistence.error]
        driver = AllocatorDriver(persistence.saved)
        driver.add(('t4', 0, 0))
        persistence.save(driver.core, driver.now)
        assert 'tried again' not in persistence.error
        persistence.close()
    assert {'t1', 't3', 't4'} == {record.task.id for record in Persistence(
        str(tmp_path), print).saved.tasks}


def test_finding_23_a_row_whose_id_is_no_text_costs_that_row_only(tmp_path):
    filled(tmp_path).close()
    database = sqlite3.connect(tmp_path / FILE_NAME)
    database.execute("INSERT INTO world VALUES ('task', CAST(x'ff' AS TEXT), '1')")
    database.execute("INSERT INTO world VALUES (7, x'00', '1')")
    database.commit()
    database.close()
    persistence = Persistence(str(tmp_path), print)
    assert len(persistence.saved.tasks) == 3
    assert len(persistence.saved.unreadable) == 2


def test_finding_23_no_value_of_a_row_ends_a_start(rows):
    """Every value of every row replaced by hostile ones; the allocator starts and plans."""
    rng = random.Random(23)
    print('seed 23')
    for k, row in enumerate(rows):
        for path in paths(row.body):
            for value in rng.sample(HOSTILE, 5):
                bad = JournalRow(row.kind, row.id, with_value(row.body, path, value))
                found = restored_state([*rows[:k], bad, *rows[k + 1:]])
                driver = AllocatorDriver(found)
                driver.uav('a', 0.0, 0.0, 50.0)
                driver.settle()
                json.dumps([each.body for each in driver.core.rows()])
                assert 2 <= len(found.tasks) <= 3
                assert found.unreadable or len(found.tasks) == 3


def test_finding_23_one_damaged_zone_costs_that_zone_only(rows):
    k = next(k for k, row in enumerate(rows) if row.kind == 'zones')
    bad = JournalRow('zones', '', with_value(rows[k].body, (0, 'radius'), math.nan))
    found = restored_state([*rows[:k], bad, *rows[k + 1:]])
    assert [zone.id for zone in found.zones] == ['z2']
    assert 'zone z1' in found.unreadable[0] or 'zone radius = nan' in found.unreadable[0]


TIMED = Task('t', (1.0, 2.0, 3.0), earliest=-5.0, latest=60.0, release=2.0, announced=-9.0,
             payload=0.5)


@pytest.mark.parametrize('task', [TIMED, Task('t', (1.0, 2.0, 3.0))])
def test_times_and_payload_of_a_task_are_restored(tmp_path, task):
    journal = Journal(str(tmp_path))
    journal.put([task_row(TaskRecord(task, task))])
    record, = restored_state(journal.load()).tasks
    journal.close()
    assert record.task == task


def test_a_journal_from_before_there_were_windows_is_read():
    row = task_row(TaskRecord(TIMED, TIMED))
    for name in ('earliest', 'latest', 'release', 'announced', 'payload'):
        del row.body['task'][name]
    state = restored_state([row])
    assert state.unreadable == []
    assert state.tasks[0].task == Task('t', (1.0, 2.0, 3.0))
