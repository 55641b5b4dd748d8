# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable
from typing import Generic, TypeVar

_Result = TypeVar('_Result')

class Future(Generic[_Result]):
    def result(self) -> _Result | None: ...
    def add_done_callback(self, callback: Callable[[Future[_Result]], object]) -> None: ...
