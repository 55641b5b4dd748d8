# SPDX-License-Identifier: Apache-2.0
from typing import Any, Generic, TypeVar

_Message = TypeVar('_Message')

class _Handle:
    def __enter__(self) -> None: ...
    def __exit__(self, *error: object) -> None: ...
    def take_message(self, msg_type: type[_Message], raw: bool) -> tuple[_Message, Any] | None: ...

class Subscription(Generic[_Message]):
    msg_type: type[_Message]
    @property
    def handle(self) -> _Handle: ...
