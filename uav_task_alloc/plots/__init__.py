# SPDX-License-Identifier: Apache-2.0
"""Figures of a plan, from above, in three dimensions and over time, and of a flight."""
from uav_task_alloc.palette import uav_colour
from uav_task_alloc.plots.flight import draw_flight
from uav_task_alloc.plots.plan import draw_plan
from uav_task_alloc.plots.space import draw_plan_3d
from uav_task_alloc.plots.times import draw_plan_times

__all__ = ['draw_flight', 'draw_plan', 'draw_plan_3d', 'draw_plan_times', 'uav_colour']
