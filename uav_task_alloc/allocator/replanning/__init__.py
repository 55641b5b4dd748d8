# SPDX-License-Identifier: Apache-2.0
"""When and how the allocator plans again, and which changes of a plan it accepts."""
