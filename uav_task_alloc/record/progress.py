# SPDX-License-Identifier: Apache-2.0
"""How far a run is: the lines a person reads meanwhile, and whether it is over."""
from __future__ import annotations

import math

from uav_task_alloc.record.run_state import FINAL, Line, RunState
from uav_task_alloc.scenario import Scenario

AT_REST = 0.5  # [m/s]
SILENT = 2.0  # [s] wall time after which a UAV is shown as silent


def headline(heard: RunState, clock: float) -> str:
    """One line: tasks by state, re-plans, zones; `clock` [s] of the scenario."""
    counts = ''.join(f', {heard.count(state)} {state.lower()}' for state in (
        'ACTIVE', 'ASSIGNED', 'PENDING', 'UNASSIGNED', 'REJECTED', 'FAILED', 'CANCELLED')
        if heard.count(state))
    text = (f'{clock:5.0f} s  {heard.count("COMPLETED")} of {len(heard.tasks)} tasks completed'
            f'{counts}; {len(heard.zones_now())} zones')
    if heard.solves:
        last = heard.solves[-1]
        text += (f'; {len(heard.solves) - 1} re-plans, last {last.milliseconds:.0f} ms'
                 + f' ({last.trigger})' * bool(last.trigger))
    return text


def fleet(heard: RunState, now: float) -> list[str]:
    """One line for each UAV; `now` [unix s]."""
    lines = []
    for uav, state in sorted(heard.uavs.items()):
        todo = heard.lists.get(uav, {'tasks': []})['tasks']
        doing = 'silent' if now - state['wall'] > SILENT else state['mode'].lower()
        battery = state['battery']
        lines.append(
            f'  {uav:8} {doing:10} {state["active"] or "-":8} {len(todo):3} to fly  '
            f'mission {state["mission_state"].lower():9} '
            + ('' if battery is None else f'battery {100.0 * battery:3.0f} %  ')
            + authority(heard, uav, now))
    return lines


def authority(heard: RunState, uav: str, now: float) -> str:
    """Who has a UAV, since when, why, and what gives it back; why it is not available."""
    state, said = heard.uavs[uav], heard.authority.get(uav)
    name, reason = state.get('authority', ''), state.get('reason', '')
    if said is None or said.state != name:
        known = f'authority {name.lower()}' if name not in ('', 'UNKNOWN') else ''
        return ': '.join(filter(None, (known, reason)))
    age = '' if said.since is None else f' for {max(0.0, now - said.since):.0f} s'
    text = f'authority {name.lower()}{age}: {said.why}'
    text += f'; given back by {said.back}' if said.back else ''
    return text if not reason or said.why in reason else f'{text}; not available: {reason}'


def is_over(heard: RunState, scenario: Scenario, clock: float) -> bool:
    """Whether all of a scenario was announced and settled, and its living UAVs are at rest."""
    dead = {uav.id for uav in scenario.uavs if uav.dies_at is not None}
    return (clock > scenario.duration
            and heard.tasks.keys() >= {timed.task.id for timed in scenario.tasks}
            and all(name in heard.statuses and heard.statuses[name].state in FINAL
                    for name in heard.tasks)
            and all(uav.id in dead or _at_rest(heard.uavs.get(uav.id))
                    for uav in scenario.uavs))


def _at_rest(state: Line | None) -> bool:
    if state is None:
        return False
    speed = math.hypot(*(v or 0.0 for v in state['velocity']))
    return speed < AT_REST and state['mode'] in ('STANDBY', 'HOLD', 'FAULT')
