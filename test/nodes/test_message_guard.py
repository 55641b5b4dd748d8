# SPDX-License-Identifier: Apache-2.0
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.nodes.ros.message_guard import MessageGuard


def failing(error):
    def handle():
        raise error
    return handle


def test_what_handling_raises_is_logged_once_for_each_topic_and_reason():
    lines = []
    guard = MessageGuard(lines.append)
    for _ in range(3):
        guard.handle('zones', failing(InvalidValue('margin', -1.0, 'at least 0')))
        guard.handle('tasks', failing(KeyError('id')))
    guard.refuse('zones', InvalidValue('margin', -2.0, 'at least 0'))
    assert lines == ['zones: margin = -1.0: expected at least 0: ignored; logged once',
                     "tasks: KeyError: 'id': ignored; logged once",
                     'zones: margin = -2.0: expected at least 0: ignored; logged once']


def test_a_message_that_is_handled_logs_nothing():
    lines, done = [], []
    MessageGuard(lines.append).handle('zones', lambda: done.append('zones'))
    assert (lines, done) == ([], ['zones'])


def test_a_flood_of_reasons_ends_and_no_text_writes_to_the_terminal():
    lines = []
    guard = MessageGuard(lines.append)
    for k in range(1000):
        guard.refuse('zones', ValueError(f'{k}\x1b[2J'))
    assert len(lines) == 200
    assert '\x1b' not in ''.join(lines)
