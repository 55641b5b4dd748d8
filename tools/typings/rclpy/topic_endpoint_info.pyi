# SPDX-License-Identifier: Apache-2.0
from rclpy.qos import QoSProfile

class TopicEndpointInfo:
    @property
    def node_name(self) -> str: ...
    @property
    def endpoint_gid(self) -> list[int]: ...
    @property
    def qos_profile(self) -> QoSProfile: ...
