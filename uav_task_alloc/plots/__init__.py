# SPDX-License-Identifier: Apache-2.0
"""Figures of a plan, from above and in three dimensions, and of a flight; needs no display."""
from uav_task_alloc.palette import uav_colour
from uav_task_alloc.plots.flight import draw_flight
from uav_task_alloc.plots.plan import draw_plan
from uav_task_alloc.plots.space import draw_plan_3d

__all__ = ['draw_flight', 'draw_plan', 'draw_plan_3d', 'uav_colour']
