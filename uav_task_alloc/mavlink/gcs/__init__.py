# SPDX-License-Identifier: Apache-2.0
"""The ground station without I/O: who has each aircraft, and what flies its list."""
