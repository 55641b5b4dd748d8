# SPDX-License-Identifier: Apache-2.0
"""Lines of a record as sentences: what a line tells that was not known before it."""
from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from uav_task_alloc.record.run_state import Line, RunState

_NAMED = 3  # ids in one sentence
Sentence = tuple[str, str]  # (kind: task, good, fault, zone, uav or plan; sentence)
SAID = {  # state of a task: (kind of event, sentence)
    'ACTIVE': ('uav', '{uav} flies to {tasks}'),
    'COMPLETED': ('good', '{tasks} completed by {uav}'),
    'FAILED': ('fault', '{tasks} failed: {reason}'),
    'CANCELLED': ('task', '{tasks} withdrawn'),
    'REJECTED': ('fault', '{tasks} refused: {reason}'),
    'UNASSIGNED': ('fault', '{tasks} left out: {reason}'),
}
ANNOUNCED = {'ADD': 'announced: {}', 'UPDATE': 'changed: {}', 'CANCEL': 'to be withdrawn: {}'}


def some(names: Iterable[str]) -> str:
    """`t1, t2, t3 and 4 more`."""
    given = list(names)
    more = len(given) - _NAMED
    return ', '.join(given[:_NAMED]) + (f' and {more} more' if more > 0 else '')


def sentences(heard: RunState, line: Line) -> Iterator[Sentence]:
    """What `line` tells; `heard` has not taken it yet."""
    teller = TELLERS.get(line['kind'])
    return teller(heard, line) if teller else iter(())


def announcement_sentences(_: RunState, line: Line) -> Iterator[Sentence]:
    """Tasks that came, changed or went."""
    if line['tasks'] and line['action'] in ANNOUNCED:
        yield 'task', ANNOUNCED[line['action']].format(some(row['id'] for row in line['tasks']))


def moved(heard: RunState, line: Line) -> Iterator[Sentence]:
    """Tasks whose state is new, those that share it in one sentence."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for row in line['statuses']:
        old = heard.statuses.get(row['task'])
        if row['state'] in SAID and (
                old is None or (old.state, old.reason) != (row['state'], row['reason'])):
            groups.setdefault((row['state'], row['uav'], row['reason']), []).append(row['task'])
    for (state, uav, reason), tasks in groups.items():
        kind, text = SAID[state]
        yield kind, text.format(tasks=some(tasks), uav=uav or 'nobody',
                                reason=reason or 'no reason was told')


def zone_sentences(heard: RunState, line: Line) -> Iterator[Sentence]:
    """Zones that came, changed or went."""
    old = {zone.id for zone in heard.zones_now()}
    new = {row['id'] for row in line['zones']}
    for names, text in ((new - old, 'new zone {}'), (old - new, 'zone {} is gone')):
        if names:
            yield 'zone', text.format(some(sorted(names)))


def flown(heard: RunState, line: Line) -> Iterator[Sentence]:
    """A UAV that was not known, or does something else, or carries another list."""
    uav, old = line['uav'], heard.uavs.get(line['uav'])
    if old is None:
        yield 'uav', f'{uav} heard for the first time'
        return
    if line['mode'] != old['mode']:
        kind = 'fault' if line['mode'] == 'FAULT' else 'uav'
        yield kind, f'{uav}: {line["mode"].lower().replace("_", " ")}'
    reason, authority = line.get('reason', ''), line.get('authority', '')
    if line['available'] != old['available']:
        word = 'available' if line['available'] else 'not available'
        yield 'fault', ': '.join(filter(None, (uav, word, reason)))
    if authority != old.get('authority', authority) and 'authority' not in reason:
        yield 'uav', f'{uav}: authority {authority}'
    if line['mission_state'] != old['mission_state'] and line['mission_state'] in (
            'MIXED', 'FOREIGN'):
        yield 'fault', f'{uav}: the mission on board is {line["mission_state"].lower()}'
    if line['list_revision'] > old['list_revision']:
        yield 'uav', f'{uav} has list {line["list_revision"]} on board, read back'


TELLERS: dict[str, Callable[[RunState, Line], Iterator[Sentence]]] = {
    'announcement': announcement_sentences,
    'statuses': moved,
    'zones': zone_sentences,
    'state': flown,
}
