# SPDX-License-Identifier: Apache-2.0
from typing import Generic, TypeVar

_Request = TypeVar('_Request')
_Response = TypeVar('_Response')

class _ServiceType(Generic[_Request, _Response]):
    """Base that the stubs of generated services have, so that callbacks are checked."""

class Service: ...
