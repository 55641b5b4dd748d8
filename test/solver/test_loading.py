# SPDX-License-Identifier: Apache-2.0
"""All kernels are loaded before the budget of a plan begins."""
import re
import subprocess
import sys


def run(script):
    """A process that has run a script."""
    return subprocess.run([sys.executable, '-c', script], capture_output=True, text=True,
                          check=True)


LOADED = """
import sys

from numba.core.registry import CPUDispatcher

from uav_task_alloc import Task, ThreatZone, Uav, plan
from uav_task_alloc.solver.solve import load_kernels
from uav_task_alloc.solver.timed.solve import load_timed_kernels


def loaded():
    return {f'{name}.{key}{each}' for name, module in list(sys.modules.items())
            if name.startswith('uav_task_alloc') for key, kernel in vars(module).items()
            if isinstance(kernel, CPUDispatcher) for each in kernel.signatures}

"""
SCRIPT = LOADED + """
load_kernels(search=False)
before = loaded()
uavs = [Uav(f'u{i}', (100.0 * i, 0.0, 0.0), 150.0) for i in range(4)]
tasks = [Task(f't{i}', (10.0 * i, 40.0 + 7.0 * (i % 5), 0.0), value=1.0 + i % 3,
              allowed_uavs=frozenset({'u1'}) if i % 9 == 0 else None) for i in range(40)]
dome = ThreatZone.hemisphere('dome', (150.0, 40.0, 0.0), 20.0)
plan(uavs, tasks, max_iterations=0)
plan([Uav(f'b{i}', (0.0, 0.0, 0.0), 150.0) for i in range(4)], tasks, max_iterations=0)
print('late:', *sorted(loaded() - before))
load_kernels()
load_kernels(zones=True)
before |= loaded()
for zones, end, hard in (((), 'hold', True), ((dome,), 'home', True), ((), 'home', False)):
    known = plan(uavs, tasks[:-5], zones, route_end=end, hard_range=hard, max_iterations=2000)
    plan(uavs, tasks[5:], zones, route_end=end, hard_range=hard, max_iterations=2000, warm=known)
plan(uavs, tasks, locked={'u0': ['t1']}, max_iterations=2000)
print('late:', *sorted(loaded() - before))
"""


def test_a_first_plan_and_a_tight_world_with_zones_find_all_kernels_loaded():
    assert run(SCRIPT).stdout == 'late:\nlate:\n'


SERVED = LOADED + """
from uav_task_alloc.solver import tables

load_kernels(zones=True)
before = loaded()
uavs = [Uav(f'u{i}', (10.0 * i, 0.0, 0.0)) for i in range(6)]
tasks = [Task(f't{i}', (10.0 * i, 40.0 + 7.0 * (i % 5), 0.0)) for i in range(40)]
dome = ThreatZone.hemisphere('dome', (150.0, 50.0, 0.0), 2.0)
print(len(plan(uavs, tasks, [dome], max_iterations=2000).unassigned))
print('late:', *sorted(loaded() - before))
print(len(tables._copy_known_rows.signatures))  # of scouts that go on from learnt tables
"""


def test_a_world_with_zones_whose_tasks_are_all_served_finds_all_kernels_loaded():
    assert run(SERVED).stdout == '0\nlate:\n1\n'


LATE = LOADED + """
load_timed_kernels()
before = loaded()
tasks = [Task('near', (90.0, 0.0, 0.0), latest=99.0), Task('far', (9e4, 0.0, 0.0), latest=1.0)]
print('far' in plan([Uav('u', (0.0, 0.0, 0.0))], tasks, max_iterations=10).unassigned)
print('late:', *sorted(loaded() - before))
"""


def test_the_reason_of_a_task_that_nobody_can_reach_in_time_finds_all_kernels_loaded():
    assert run(LATE).stdout == 'True\nlate:\n'


CLOSED = LOADED + """
load_kernels(zones=True, search=False)
load_timed_kernels(zones=True, search=False)
before = loaded()
ring = [ThreatZone.polygon(f'z{k}', corners) for k, corners in enumerate((
    ((-9.0, -9.0), (9.0, -9.0), (9.0, -8.0), (-9.0, -8.0)),
    ((-9.0, 8.0), (9.0, 8.0), (9.0, 9.0), (-9.0, 9.0)),
    ((-9.0, -9.0), (-8.0, -9.0), (-8.0, 9.0), (-9.0, 9.0)),
    ((8.0, -9.0), (9.0, -9.0), (9.0, 9.0), (8.0, 9.0))))]
for objective in ('distance', 'finish'):
    print(*plan([Uav('u', (50.0, 0.0, 0.0))], [Task('t', (0.0, 0.0, 0.0))], ring,
                objective=objective, budget=9.0, max_iterations=0).unassigned.values())
print('late:', *sorted(loaded() - before))
"""


def test_the_reason_of_a_task_that_no_path_leads_to_finds_all_kernels_loaded():
    assert run(CLOSED).stdout == 2 * 'unreachable: no safe path past the zones\n' + 'late:\n'


SELECTED = LOADED + """
load_timed_kernels()
before = loaded()
tasks = [Task(f't{i}', (1.0 + i % 7, 1.0 + i // 7, 0.0), latest=20.0) for i in range(70)]
print(len(plan([Uav('u', (0.0, 0.0, 0.0), cruise_speed=1.0)], tasks, route_end='home',
               max_iterations=3000).routes['u']) > 15)
print('late:', *sorted(loaded() - before))
"""


def test_a_search_that_selects_tasks_finds_all_kernels_loaded():
    assert run(SELECTED).stdout == 'True\nlate:\n'


COMBINED = LOADED + """
load_timed_kernels(few=True)
before = loaded()
tasks = [Task(f't{i}', (1.0 + i % 7, 1.0 + i // 7, 0.0), latest=20.0) for i in range(70)]
uavs = [Uav(name, (0.0, 0.0, 0.0), cruise_speed=1.0) for name in 'uv']
print(len(plan(uavs, tasks, max_iterations=3000).routes['u']) > 9)
print('late:', *sorted(loaded() - before))
"""


def test_a_search_that_combines_routes_of_few_uavs_finds_all_kernels_loaded():
    assert run(COMBINED).stdout == 'True\nlate:\n'


MANY = LOADED + """
load_timed_kernels(large=True)
before = loaded()
tasks = [Task(f't{i}', (1.0 + i % 20, 1.0 + i // 20, 0.0), latest=99.0) for i in range(200)]
uavs = [Uav(f'u{i}', (0.0, 0.0, 0.0)) for i in range(30)]
print(len(plan(uavs, tasks, max_iterations=1000).routes))
print('late:', *sorted(loaded() - before))
"""


def test_a_search_of_many_tasks_with_time_finds_all_kernels_loaded():
    assert run(MANY).stdout == '30\nlate:\n'


FEW = LOADED + """
tasks = [Task(f't{i}', (1.0 + i, 0.0, 0.0), latest=99.0) for i in range(9)]
plan([Uav('u', (0.0, 0.0, 0.0))], tasks, max_iterations=1000)
print(*(each for each in loaded() if '.tails' in each or 'multipliers' in each))
"""


def test_a_search_of_few_tasks_with_time_loads_none_for_many():
    assert run(FEW).stdout == '\n'


FOR_PYTHON = """
from uav_task_alloc.geometry import scene, shortest_path
from uav_task_alloc.geometry.detour import find_detour
from uav_task_alloc.model import ThreatZone
from uav_task_alloc.solver.solve import load_kernels

load_kernels(zones=True)
dome = ThreatZone.hemisphere('dome', (50.0, 0.0, 0.0), 20.0)
print(len(find_detour((0.0, 0.0, 0.0), (90.0, 0.0, 5.0), [dome]).points) > 0)
for kernel in (shortest_path.shortest_path, shortest_path.path_clears, scene.stored_ends):
    print('from_python' in vars(kernel))
"""


def test_kernels_that_search_paths_are_compiled_only_within_those_that_call_them():
    assert run(FOR_PYTHON).stdout.split() == ['True', 'False', 'False', 'False']


NO_ZONES = """
from uav_task_alloc.geometry import distances, obstacles, shortest_path
from uav_task_alloc.solver.solve import load_kernels

load_kernels()
for kernel in (shortest_path.shortest_path, distances.stored_path, obstacles.containing_zones):
    print(len(kernel.signatures))
"""


def test_without_zones_no_kernel_that_finds_paths_around_them_is_loaded():
    assert run(NO_ZONES).stdout.split() == ['0', '0', '0']


NOTICE = """
import os
import sys

from uav_task_alloc.kernel_cache import NOTICE, KernelWork
from uav_task_alloc.solver.{solver} import {load}

for zones, search in ((False, False), (True, False), (True, True)):
    if os.fork():  # a process for each, which has loaded no kernel
        assert os.wait()[1] == 0
        continue
    with NOTICE.until_loaded('other', KernelWork(99.0, 9)):  # compiles nothing, prints nothing
        pass
    {load}(zones=zones, search=False)
    if search:
        {load}(zones=zones)
    NOTICE.on_start(type('Event', (), dict(data=dict(module='uav_task_alloc.a', name='ssa'))))
    sys.exit()
"""
STATED = r'compiling kernels \(once, about (\d+) s(?: to a first plan, (\d+) s in all)?\)\n'


def test_the_notice_states_the_time_of_what_is_loaded():
    for solver, load in (('solve', 'load_kernels'), ('timed.solve', 'load_timed_kernels')):
        done = run(NOTICE.format(solver=solver, load=load))
        (first, whole), (first_zones, whole_zones), rest = (
            [float(each or 0.0) for each in re.fullmatch(STATED, line).groups()]
            for line in done.stderr.splitlines(keepends=True))
        assert 0.0 < first < whole < whole_zones < 99.0
        assert first < first_zones
        assert rest == [whole - first, 0.0]
