# SPDX-License-Identifier: Apache-2.0
"""The lists of a plan as they may be published: no accepted deadline is broken, UAVs are apart."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from uav_task_alloc.allocator.replanning.built_lists import BuiltLists, build_lists
from uav_task_alloc.allocator.replanning.from_now import separation_of
from uav_task_alloc.allocator.replanning.held_deadlines import held_lists
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.model import Plan


def lists_to_publish(world: World, chosen: Plan, stamp: float) -> BuiltLists:
    """Build the lists of a plan that may be put in force; the world is not changed.

    Args:
        world: as it is now.
        chosen: plan, for this world or an earlier one.
        stamp: [s] published clock.

    Returns:
        Lists that are apart, without those that would break a deadline that is accepted.
    """
    built = build_lists(world, chosen, stamp)
    lists, why = held_lists(world, built.lists, stamp)
    return lists_apart(world, replace(built, lists=lists, left_out={**built.left_out, **why}),
                       stamp)


def lists_apart(world: World, built: BuiltLists, stamp: float) -> BuiltLists:
    """Return lists with what keeps their UAVs apart, see `with_separation`.

    Args:
        world: as it is now.
        built: lists that would be put in force.
        stamp: [s] published clock.

    Returns:
        The same lists where separation is off.
    """
    if not separation_of(world.params).on:
        return built
    from uav_task_alloc.allocator.replanning.separated_lists import (  # imports numba
        with_separation,
    )
    return with_separation(world, built, stamp)


def holding_plan(world: World, plans: Sequence[Plan], stamp: float) -> Plan:
    """Return the first plan that breaks no deadline which the lists in force keep.

    Args:
        world: as it is now.
        plans: in the order of preference.
        stamp: [s] published clock.

    Returns:
        The first of all where each breaks one: its lists are held back, see `held_lists`.
    """
    if all(math.isinf(record.task.latest) for record in world.tasks.open()):
        return plans[0]
    for each in plans:
        lists = build_lists(world, each, stamp).lists
        held, _ = held_lists(world, lists, stamp)
        if all(held[uav_id] is lists[uav_id] for uav_id in lists):
            return each
    return plans[0]
