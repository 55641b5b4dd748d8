# SPDX-License-Identifier: Apache-2.0
class Time:
    @property
    def nanoseconds(self) -> int: ...
