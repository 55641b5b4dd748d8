# SPDX-License-Identifier: Apache-2.0
"""Fences and rally points on board, without I/O: shapes, choice, transfer, and state."""
