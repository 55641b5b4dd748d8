# SPDX-License-Identifier: Apache-2.0
"""Names of the topics that contain the id of a UAV, and how long such an id may be."""
from __future__ import annotations

from rclpy.node import Node

from uav_task_alloc.errors import InvalidValue

_LONGEST_TOPIC = 247  # characters of a topic's full name; rcl raises beyond
TASK_LIST, PATH, HOLD = '{}/task_list', '{}/path', '{}/hold'


def check_topic(node: Node, pattern: str, uav_id: str) -> str:
    """Return the topic of a UAV, relative to the node's namespace.

    Args:
        node: which publishes or subscribes.
        pattern: TASK_LIST, PATH or HOLD.
        uav_id: a ROS name.

    Returns:
        A relative name.

    Raises:
        InvalidValue: the id is too long for a topic's name in this namespace.
    """
    namespace = node.get_namespace().rstrip('/')
    most = _LONGEST_TOPIC - len(namespace) - 1 - len(pattern.format(''))
    if len(uav_id) > most:
        raise InvalidValue('uav_id', uav_id, f'at most {most} characters in namespace '
                           f'{namespace or "/"}: a topic has at most {_LONGEST_TOPIC}')
    return pattern.format(uav_id)
