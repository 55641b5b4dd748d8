# SPDX-License-Identifier: Apache-2.0
"""The page docs/scenarios.md, made from the tables that a file is read with."""
from __future__ import annotations

import math
from typing import Any

from uav_task_alloc.scenario.checked_yaml import REQUIRED
from uav_task_alloc.scenario.schema import TABLES

INTRO = """# Scenario files

Made by `python -m uav_task_alloc params --write` from `uav_task_alloc/scenario/schema.py`.

A scenario is a YAML file: a fleet, and the tasks and zones that come and go at their times. The
same file serves `python -m uav_task_alloc plan`, which needs `uavs`, `tasks` and `zones` only,
and a flight, where `fleet_sim` builds the UAVs and `scenario_player` announces the rest. Times
are seconds of the scenario, played `speedup` times faster; they start when an allocator listens.
Coordinates are ENU metres from `origin`.

```yaml
uavs:
  - {id: uav_1, position: [0, 0, 0]}
tasks:
  - {id: t1, position: [300, 400, 50], value: 2, service_time: 5}
  - {id: t2, position: [-200, 500, 60], at: 30}
zones:
  - {id: z1, shape: hemisphere, center: [150, 200, 0], radius: 80, margin: 5}
```

`config/scenarios/` holds more, `demo.yaml` among them. A bad file is refused with one line that
names file, line, value and what was expected:

```text
demo.yaml:11: scenario.uavs[0].range = -4: expected a number in [0, inf]
demo.yaml:14: scenario.tasks[0]: unknown key 'positon': expected one of ...; nearest is 'position'
```

`arrivals` are drawn from `seed` when the file is read: the same file gives the same tasks.
"""


def scenario_page() -> str:
    """The whole page."""
    parts = [INTRO]
    for name, table in TABLES.items():
        parts.append(f'\n## {name}\n\n| key | default | expected | what |\n|---|---|---|---|\n')
        for key, entry in table.items():
            parts.append(f'| `{key}` | {_default(entry.default)} | {entry.kind.words} | '
                         f'{entry.text} |\n')
    return ''.join(parts)


def _default(value: Any) -> str:
    if value is REQUIRED:
        return 'required'
    if value is None or value == ():
        return ''
    if isinstance(value, float) and math.isinf(value):
        return '`.inf`' if value > 0 else '`-.inf`'
    return f'`{value}`'
