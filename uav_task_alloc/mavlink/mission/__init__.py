# SPDX-License-Identifier: Apache-2.0
"""Missions without I/O: items, transfer, comparison, progress, files."""
