# SPDX-License-Identifier: Apache-2.0
"""Allocates tasks to UAVs as they arrive, around threat zones; imports no ROS."""
import sys  # nothing before this reads a file, as `from __future__` would

if sys.argv[:1] == ['-m'] and __name__ in sys.orig_argv:  # as a program, whose first code this is
    import _signal  # type: ignore[import-not-found]

    # Python's own handler prints where an import was interrupted
    if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)

from importlib import import_module

TYPE_CHECKING = False  # without `typing`, which takes longer to load than the rest of `--version`
if TYPE_CHECKING:
    from typing import Any

    from uav_task_alloc.geometry.detour import detour
    from uav_task_alloc.model import Plan, Task, ThreatZone, Uav
    from uav_task_alloc.objective import Objective
    from uav_task_alloc.separation.rule import Separation
    from uav_task_alloc.solver.registry import SOLVERS
    from uav_task_alloc.solver.solve import plan

__all__ = ['SOLVERS', 'Objective', 'Plan', 'Separation', 'Task', 'ThreatZone', 'Uav', 'detour',
           'plan']
__version__ = '0.1.0'
_MODULES = {'SOLVERS': 'solver.registry', 'Objective': 'objective', 'plan': 'solver.solve',
            'detour': 'geometry.detour', 'Separation': 'separation.rule',
            **dict.fromkeys(('Plan', 'Task', 'ThreatZone', 'Uav'), 'model')}


def __getattr__(name: str) -> 'Any':
    """Import a public name at its first use, so that nodes start without loading numba."""
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_MODULES[name]}'), name)


def __dir__() -> 'list[str]':
    """The public names, also those that are not imported yet."""
    return sorted({*globals(), *__all__})
