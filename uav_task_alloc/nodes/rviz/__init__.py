# SPDX-License-Identifier: Apache-2.0
"""The allocation as markers for RViz."""
