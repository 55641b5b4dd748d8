# SPDX-License-Identifier: Apache-2.0
"""Finds publishers of a node's inputs whose QoS is such that it receives nothing of them."""
from __future__ import annotations

from collections.abc import Mapping

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def unheard_publishers(node: Node, inputs: Mapping[str, QoSProfile]) -> list[str]:
    """Return a sentence for each publisher that is not received.

    Args:
        node: which subscribes.
        inputs: the profile of the subscription, by topic.

    Returns:
        Topic, name of the publishing node, what it offers, and what is expected.
    """
    found = []
    for topic, wanted in inputs.items():
        for info in node.get_publishers_info_by_topic(topic):
            if lack := _lack(info.qos_profile, wanted):
                found.append(f'{topic}: nothing is received of {info.node_name}, which offers '
                             f'{lack}')
    return sorted(set(found))


def _lack(offered: QoSProfile, wanted: QoSProfile) -> str:
    """What a publisher offers less of than a subscription wants; '' where that is enough."""
    if (wanted.reliability is ReliabilityPolicy.RELIABLE
            and offered.reliability is ReliabilityPolicy.BEST_EFFORT):
        return 'reliability best_effort: expected reliable'
    if (wanted.durability is DurabilityPolicy.TRANSIENT_LOCAL
            and offered.durability is DurabilityPolicy.VOLATILE):
        return 'durability volatile: expected transient_local'
    return ''
