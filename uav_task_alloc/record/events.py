# SPDX-License-Identifier: Apache-2.0
"""Events of a run as sentences: the changes that a line of the record brings."""
from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from uav_task_alloc.errors import first_of
from uav_task_alloc.record.record_file import Line
from uav_task_alloc.record.reported import is_refused
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.zone_codec import decode_zone

_MAX_NAMED = 3  # ids in one sentence
Sentence = tuple[str, str]  # (kind: task, good, fault, zone, uav or plan; sentence)
STATE_SENTENCES = {  # by state of a task: (kind of event, sentence)
    'ACTIVE': ('uav', '{uav} flies to {tasks}'),
    'COMPLETED': ('good', '{tasks} completed by {uav}'),
    'FAILED': ('fault', '{tasks} failed: {reason}'),
    'CANCELLED': ('task', '{tasks} withdrawn'),
    'REJECTED': ('fault', '{tasks} refused: {reason}'),
    'UNASSIGNED': ('fault', '{tasks} left out: {reason}'),
}
ACTION_TEXTS = {'ADD': 'announced: {}', 'UPDATE': 'changed: {}', 'CANCEL': 'to be withdrawn: {}'}


def sentences(state: RunState, line: Line) -> Iterator[Sentence]:
    """Return the events in a line of a record.

    Args:
        state: of the run before `line`.
        line: of the record.

    Returns:
        (kind, sentence) each; none for lines without events.
    """
    build = SENTENCE_BUILDERS.get(line['kind'])
    return build(state, line) if build else iter(())


def announcement_sentences(state: RunState, line: Line) -> Iterator[Sentence]:
    """Announced, changed and withdrawn tasks, where that may have changed anything."""
    names = [row['id'] for row in line['tasks'] if not _changes_nothing(state, line, row)]
    if names and line['action'] in ACTION_TEXTS:
        yield 'task', ACTION_TEXTS[line['action']].format(_ids(names))


def _changes_nothing(state: RunState, line: Line, row: Line) -> bool:
    """Whether an allocator refuses what is announced of a task, or has done it before."""
    task_id, action = row['id'], line['action']
    known, status = state.tasks.get(task_id), state.statuses.tasks.get(task_id)
    if action == 'ADD':
        return known is not None and status is not None and status.state != 'REJECTED'
    if state.statuses.is_refused(task_id):
        return True
    if state.statuses.in_newest(task_id) is None:  # not announced, or forgotten
        return state.statuses.is_forgotten(task_id) or (
            known is None and bool(state.statuses.tasks))
    if action == 'CANCEL':
        return task_id in state.cancelled or (
            status is not None and status.state in ('COMPLETED', 'CANCELLED'))
    now = line['wall'] - state.allocators.lead.seconds
    return known is not None and status is not None and is_refused(
        known, status, row, action, now)


def status_sentences(state: RunState, line: Line) -> Iterator[Sentence]:
    """Tasks in a new state; tasks of the same state, UAV and reason share a sentence."""
    groups: dict[tuple[str, str, str], list[str]] = {}
    for row in line['statuses']:
        old = state.statuses.in_newest(row['task'])
        if row['state'] in STATE_SENTENCES and (
                old is None or (old.state, old.reason) != (row['state'], row['reason'])):
            groups.setdefault((row['state'], row['uav'], row['reason']), []).append(row['task'])
    for (name, uav, reason), tasks in groups.items():
        kind, text = STATE_SENTENCES[name]
        if name == 'CANCELLED' and reason.startswith('cut again'):  # of pieces, by no operator
            kind, text = 'task', '{tasks} {reason}'
        if name == 'COMPLETED' and not uav:  # work of which several flew pieces
            text = '{tasks} completed'
        yield kind, text.format(tasks=_ids(tasks), uav=uav or 'no UAV',
                                reason=reason or 'no reason given')


def proposal_sentences(state: RunState, line: Line) -> Iterator[Sentence]:
    """A plan that waits for an operator, or what became of it."""
    changes = first_of(line['changes'], separator='; ')
    text = f'plan {line["revision"]} waits for approval: {changes}' if line['open'] else changes
    if state.proposal is None or state.proposal['changes'] != line['changes']:
        yield 'plan', text


def zone_sentences(state: RunState, line: Line) -> Iterator[Sentence]:
    """Zones that are new, changed or removed."""
    old = {zone.id: zone for zone in state.zones_now()}
    given = {row['id']: decode_zone(row) for row in line['zones']}
    new = given.keys() | old.keys() & set(line.get('kept', ()))
    changed = {name for name in given.keys() & old.keys() if given[name] != old[name]}
    for names, text in ((new - old.keys(), 'new zone {}'), (changed, 'zone {} changed'),
                        (old.keys() - new, 'zone {} removed')):
        if names:
            yield 'zone', text.format(_ids(sorted(names)))


def separation_sentences(_: RunState, line: Line) -> Iterator[Sentence]:
    """Who would lose separation, how near, and what is done."""
    kind = 'fault' if line['action'] == 'UNRESOLVED' else 'uav'
    names = ' and '.join(line['uavs'])
    if line['horizontal'] is None:
        goes_on = f'{line["holder"]} goes on: ' if line['action'] == 'RELEASE' else ''
        yield kind, f'{names}: {goes_on}{line["reason"]}'
        return
    when = f'in {line["until"]:.0f} s' if line['until'] > 0.0 else 'now'
    height = '' if line['vertical'] is None else f', {line["vertical"]:.0f} m in height'
    yield kind, (f'{names} would be {line["horizontal"]:.0f} m apart{height}, {when}: '
                 f'{line["reason"]}')


def state_sentences(state: RunState, line: Line) -> Iterator[Sentence]:
    """A new UAV, or a change of its mode, availability, authority or mission on board."""
    uav, old = line['uav'], state.uavs.get(line['uav'])
    if old is None:
        yield 'uav', f'{uav} reports for the first time'
        return
    if line['mode'] != old['mode']:
        kind = 'fault' if line['mode'] == 'FAULT' else 'uav'
        yield kind, f'{uav}: {line["mode"].lower().replace("_", " ")}'
    reason, authority = line.get('reason', ''), line.get('authority', '')
    if line['available'] != old['available']:
        text = 'available' if line['available'] else 'not available'
        yield 'fault', ': '.join(filter(None, (uav, text, reason)))
    if authority != old.get('authority', authority) and 'authority' not in reason:
        yield 'uav', f'{uav}: authority {authority}'
    if line['mission_state'] != old['mission_state'] and line['mission_state'] in (
            'MIXED', 'FOREIGN'):
        yield 'fault', f'{uav}: the mission on board is {line["mission_state"].lower()}'
    fence = line.get('fence', 'OFF')
    if fence != old.get('fence', fence) and fence in ('MIXED', 'FOREIGN', 'REFUSED'):
        yield 'fault', f'{uav}: the fence on board is {fence.lower()}'
    if line['list_revision'] > old['list_revision']:
        yield 'uav', f'{uav} has list {line["list_revision"]} verified on board'


def _ids(names: Iterable[str]) -> str:
    return first_of(names, _MAX_NAMED)


SENTENCE_BUILDERS: dict[str, Callable[[RunState, Line], Iterator[Sentence]]] = {
    'announcement': announcement_sentences,
    'statuses': status_sentences,
    'zones': zone_sentences,
    'proposal': proposal_sentences,
    'separation': separation_sentences,
    'state': state_sentences,
}
