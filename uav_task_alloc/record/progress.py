# SPDX-License-Identifier: Apache-2.0
"""Progress of a run: status lines for the terminal, and whether the run is over."""
from __future__ import annotations

import math

from uav_task_alloc.errors import counted
from uav_task_alloc.record.record_file import Line
from uav_task_alloc.record.reported import FINAL_STATES
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.scenario import Scenario

_AT_REST = 0.5  # [m/s]


def headline(run: RunState, clock: float) -> str:
    """Return the progress of a run in one line: tasks by state, zones, re-plans.

    Args:
        run: its state.
        clock: scenario time [s].

    Returns:
        Without a line break.
    """
    counts = ''.join(f', {run.statuses.count(state)} {state.lower()}' for state in (
        'ACTIVE', 'ASSIGNED', 'PENDING', 'UNASSIGNED', 'REJECTED', 'FAILED', 'CANCELLED')
        if run.statuses.count(state))
    zones = len(run.zones_now())
    completed = run.statuses.count('COMPLETED')
    known = len(run.tasks.keys() | run.statuses.known().keys())  # some only to the allocator
    text = (f'{clock:5.0f} s  {completed} of {known} tasks completed{counts}; '
            f'{counted(zones, "zone")}')
    if run.solves:
        replans = run.replans()
        last = (replans or run.solves[:1])[-1]  # a plan that changed nothing is no re-plan
        text += (f'; {counted(len(replans), "re-plan")}, last {last.milliseconds:.0f} ms'
                 + f' ({last.trigger})' * bool(last.trigger))
    return text


def fleet_lines(run: RunState, now: float) -> list[str]:
    """Return one line for each UAV.

    Args:
        run: its state.
        now: [unix s].

    Returns:
        By UAV id.
    """
    lines = []
    for uav, state in sorted(run.uavs.items()):
        remaining = run.lists.newest.get(uav, {'tasks': []})['tasks']
        activity = 'silent' if now - state['wall'] > run.silent_after else state['mode'].lower()
        battery = state['battery']
        lines.append(
            f'  {uav:8} {activity:10} {state["active"] or "-":8} {len(remaining):3} to fly  '
            f'mission {state["mission_state"].lower():9} '
            + ('' if battery is None else f'battery {100.0 * battery:3.0f} %  ')
            + authority_text(run, uav, now))
    return lines


def authority_text(run: RunState, uav: str, now: float) -> str:
    """Authority over a UAV: state, duration, reason, what gives it back; why not available.

    As all times of the display, the duration is in seconds of the scenario.
    """
    state, reported = run.uavs[uav], run.bridges.authority.get(uav)
    name, reason = state.get('authority', ''), state.get('reason', '')
    if reported is None or reported.state != name:
        known = f'authority {name.lower()}' if name not in ('', 'UNKNOWN') else ''
        return ': '.join(filter(None, (known, reason)))
    age = '' if reported.since is None else (
        f' for {run.scale.speedup * max(0.0, now - reported.since):.0f} s')
    text = f'authority {name.lower()}{age}: {reported.reason}'
    text += f'; given back by {reported.given_back_by}' if reported.given_back_by else ''
    return text if not reason or reported.reason in reason else f'{text}; not available: {reason}'


def run_is_over(run: RunState, scenario: Scenario, clock: float) -> bool:
    """Return whether all tasks of a scenario have ended, and all UAVs not lost are at rest.

    Args:
        run: its state.
        scenario: that is flown.
        clock: scenario time [s].

    Returns:
        False before the scenario's duration has passed.
    """
    dead = {uav.id for uav in scenario.uavs if uav.dies_at is not None}
    return (clock > scenario.duration
            and run.tasks.keys() >= {timed.task.id for timed in scenario.tasks}
            and all((status := run.statuses.last(name)) and status.state in FINAL_STATES
                    for name in run.tasks)
            and all(uav.id in dead or _at_rest(run.uavs.get(uav.id), run.lists.newest.get(uav.id))
                    for uav in scenario.uavs))


def _at_rest(state: Line | None, uav_list: Line | None) -> bool:
    if state is None:
        return False
    speed = math.hypot(*(v or 0.0 for v in state['velocity']))
    at_place = state['mode'] == 'ON_MISSION' and uav_list is not None and uav_list.get('waits')
    return speed < _AT_REST and (
        bool(at_place) or state['mode'] in ('STANDBY', 'HOLD', 'FAULT'))
