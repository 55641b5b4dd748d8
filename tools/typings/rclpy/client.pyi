# SPDX-License-Identifier: Apache-2.0
from typing import Generic, TypeVar

from rclpy.task import Future

_Request = TypeVar('_Request')
_Response = TypeVar('_Response')

class Client(Generic[_Request, _Response]):
    def call_async(self, request: _Request) -> Future[_Response]: ...
    def service_is_ready(self) -> bool: ...
