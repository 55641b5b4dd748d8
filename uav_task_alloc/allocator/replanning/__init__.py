# SPDX-License-Identifier: Apache-2.0
"""When and how the allocator plans anew, and what it takes of an answer."""
