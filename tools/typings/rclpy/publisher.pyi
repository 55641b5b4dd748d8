# SPDX-License-Identifier: Apache-2.0
from typing import Generic, TypeVar

_Message = TypeVar('_Message')

class Publisher(Generic[_Message]):
    def publish(self, msg: _Message) -> None: ...
    def get_subscription_count(self) -> int: ...
