# SPDX-License-Identifier: Apache-2.0
"""What nodes/ uses of rclpy 7 (Jazzy), with the types that rclpy itself does not declare.

A test compares these files with the rclpy that is installed.
"""
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

def init(*, args: list[str] | None = ..., context: Context | None = ...,
         domain_id: int | None = ...,
         signal_handler_options: SignalHandlerOptions | None = ...) -> None: ...
def ok(*, context: Context | None = ...) -> bool: ...
def try_shutdown(*, context: Context | None = ...) -> None: ...
