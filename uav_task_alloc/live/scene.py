# SPDX-License-Identifier: Apache-2.0
"""What the page shows, as plain JSON values made from what was heard; no clock, no I/O."""
from __future__ import annotations

from typing import Any

from uav_task_alloc.record import plan_diff as replans
from uav_task_alloc.record.events import sentences
from uav_task_alloc.record.progress import SILENT
from uav_task_alloc.record.run_state import Line, RunState
from uav_task_alloc.zone_codec import JSON_ZONE, encode_zone

DAY = 86400.0  # [s] a stamp older than that is of another clock
PARTS = {'announcement': 'tasks', 'statuses': 'statuses', 'zones': 'zones', 'state': 'uavs',
         'uploads': 'uavs'}  # kind of a line: the part of the scene that it makes anew
Entry = dict[str, Any]  # of a log: wall [unix s], and what the page writes


class Scene:
    """Parts of the page that became new, and entries of its two logs, since the last `news`."""

    def __init__(self, heard: RunState) -> None:
        self.heard = heard
        self.dirty: set[str] = set()
        self.events: list[Entry] = []
        self.solved: list[Line] = []  # plans not told yet
        self.routes: replans.RouteLists | None = None  # of the last plan told
        self.silent: set[str] = set()
        self.told_authority: Entry = {}

    def take(self, line: Line) -> None:
        """Note what a line changes, then fold it into `heard`."""
        self.events += [{'wall': line['wall'], 'kind': kind, 'text': text}
                        for kind, text in sentences(self.heard, line)]
        kind = line['kind']
        if kind in PARTS:
            self.dirty.add(PARTS[kind])
        elif kind == 'list':
            self.dirty.add(f'list {line["uav"]}')
        elif kind == 'allocation':
            self.solved.append(line)
        self.heard.take(line)

    def news(self, now: float) -> tuple[dict[str, Any], list[Entry], list[Entry]]:
        """(parts, events, plans) since the last call; `now` [unix s] tells who is silent.

        Plans are compared here and not as they come: the statuses that say which tasks were
        flown meanwhile are another topic and may be heard later.
        """
        plans = [self.plan(line) for line in self.solved]
        self.notice_silence(now)
        parts = {name: self.part(name) for name in self.dirty}
        authority = self.part('authority')  # apart, as it seldom changes
        if authority != self.told_authority:
            self.told_authority = parts['authority'] = authority
        told = sorted(self.events, key=lambda entry: entry['wall'])
        self.dirty, self.solved, self.events = set(), [], []
        return parts, told, plans

    def plan(self, line: Line) -> Entry:
        """A plan against the one before it."""
        done = {task for task, status in self.heard.statuses.items()
                if status.state in replans.DONE}
        after = replans.routes(line)
        first = self.routes is None
        rows = replans.changes(self.routes or {}, after, done)
        self.routes = after
        words = replans.in_words(line['trigger'])
        self.events.append({'wall': line['wall'], 'kind': 'plan', 'text': (
            f'plan {line["revision"]} ({words}): '
            f'{replans.summary(rows) or "nothing changed"}')})
        return {'wall': line['wall'], 'revision': line['revision'], 'trigger': words,
                'ms': round(line['solve_ms'], 1), 'fit': line['fit'], 'first': first,
                'changes': rows}

    def notice_silence(self, now: float) -> None:
        """Tell once of a UAV that is not heard any more, and once that it is again."""
        silent = {uav for uav, state in self.heard.uavs.items() if now - state['wall'] > SILENT}
        for names, text in ((silent - self.silent, '{} is silent'),
                            (self.silent - silent, '{} is heard again')):
            self.events += [{'wall': now, 'kind': 'fault', 'text': text.format(uav)}
                            for uav in sorted(names)]
        self.silent = silent

    def part(self, name: str) -> Any:
        """One part as the page reads it (see page/live.js)."""
        heard = self.heard
        if name == 'tasks':  # [east, north, up] [m] by id
            return {task: rounded(row.position) for task, row in heard.tasks.items()}
        if name == 'statuses':  # [state, UAV, reason] by id
            return {task: [row.state, row.uav, row.reason]
                    for task, row in heard.statuses.items()}
        if name == 'zones':
            return [encode_zone(zone, JSON_ZONE) for zone in heard.zones_now()]
        if name == 'uavs':
            return {uav: self.uav(uav, state) for uav, state in sorted(heard.uavs.items())}
        if name == 'authority':
            return {uav: self.authority(uav, state) for uav, state in sorted(heard.uavs.items())
                    if state.get('authority') or state.get('reason')}
        return self.list(name.removeprefix('list '))

    def uav(self, uav: str, state: Line) -> Entry:
        """One UAV; `wall` [unix s] when it was last heard, `health` what its bridge says."""
        level, text = self.heard.health.get(uav, (0, ''))
        battery = state['battery']
        return {'wall': round(state['wall'], 1), 'position': rounded(state['position']),
                'mode': state['mode'], 'mission': state['mission_state'],
                'active': state['active'], 'revision': state['list_revision'],
                'battery': None if battery is None else round(battery, 3),
                'range': state['range_remaining'] and round(state['range_remaining']),
                'available': state['available'], 'health': text if level else ''}

    def authority(self, uav: str, state: Line) -> Entry:
        """Who has a UAV, `since` [unix s] when, `why`, and what gives it `back`.

        `reason`: why it is not available.
        """
        name, said = state.get('authority', ''), self.heard.authority.get(uav)
        known = {'state': name, 'reason': state.get('reason', '')}
        if said is None or said.state != name:  # the bridge says why a moment later
            return {**known, 'why': '', 'since': None, 'back': ''}
        return {**known, 'why': said.why, 'back': said.back,
                'since': None if said.since is None else round(said.since)}

    def list(self, uav: str) -> Entry:
        """What a UAV has still to fly; `at` of a task: when it gets there [unix s]."""
        line, speedup = self.heard.lists[uav], self.heard.speedup
        wall, stamp = line['wall'], line.get('stamp', 0.0)
        made = stamp if 0.0 <= wall - stamp < DAY else wall
        return {'revision': line['revision'], 'tasks': [
            {'id': row['id'], 'via': [rounded(point) for point in row['via']],
             'at': round(made + row['eta'] / speedup, 1) if 'eta' in row else None}
            for row in line['tasks']]}


def rounded(point: Any) -> list[float | None]:
    """To decimetres: what a screen can show."""
    return [None if v is None else round(v, 1) for v in point]
