# SPDX-License-Identifier: Apache-2.0
"""Allocates tasks to UAVs as they arrive, around threat zones; imports no ROS."""
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from uav_task_alloc.geometry.detour import detour
    from uav_task_alloc.model import Plan, Task, ThreatZone, Uav
    from uav_task_alloc.solver.registry import SOLVERS
    from uav_task_alloc.solver.solve import plan

__all__ = ['SOLVERS', 'Plan', 'Task', 'ThreatZone', 'Uav', 'detour', 'plan']
_MODULES = {'SOLVERS': 'solver.registry', 'plan': 'solver.solve', 'detour': 'geometry.detour',
          **dict.fromkeys(('Plan', 'Task', 'ThreatZone', 'Uav'), 'model')}


def __getattr__(name: str) -> Any:
    """Import a public name at its first use, so that nodes start without loading numba."""
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_MODULES[name]}'), name)
