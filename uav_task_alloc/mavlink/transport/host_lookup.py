# SPDX-License-Identifier: Apache-2.0
"""The address of a host, looked up in a thread: that may take seconds, in which nothing waits."""
from __future__ import annotations

import socket
import threading

_START = 2.0  # [s] that the first look-up is waited for


class HostLookup:
    """The address of a host, which may change.

    Args:
        host: a name, or an IPv4 address, which is never looked up.
    """

    def __init__(self, host: str) -> None:
        self._host, self._address = host, ''
        self._error = 'its name is not looked up yet'
        self._thread: threading.Thread | None = None
        try:
            socket.inet_pton(socket.AF_INET, host)
        except OSError:
            self._begin().join(_START)
        else:
            self._address = host

    def address(self) -> str:
        """Return the address found last, at once; of a name the next look-up begins.

        Returns:
            An IPv4 address.

        Raises:
            OSError: none was found yet; the text says why.
        """
        if self._thread is not None and not self._thread.is_alive():
            self._begin()
        if not self._address:
            raise OSError(self._error)
        return self._address

    def _begin(self) -> threading.Thread:
        self._thread = threading.Thread(target=self._find, name=f'look up {self._host}',
                                        daemon=True)
        self._thread.start()
        return self._thread

    def _find(self) -> None:
        try:
            self._address = socket.gethostbyname(self._host)
        except (OSError, UnicodeError) as error:
            self._error = getattr(error, 'strerror', None) or str(error)
