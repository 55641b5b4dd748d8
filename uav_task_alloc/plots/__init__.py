# SPDX-License-Identifier: Apache-2.0
"""Pictures of a plan, from above and in space, and of a flight; drawn without a display."""
from uav_task_alloc.plots.flight import draw_flight
from uav_task_alloc.plots.plan import draw_plan
from uav_task_alloc.plots.space import draw_plan_3d
from uav_task_alloc.plots.style import COLOURS, colour

__all__ = ['COLOURS', 'colour', 'draw_flight', 'draw_plan', 'draw_plan_3d']
