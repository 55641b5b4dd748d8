# SPDX-License-Identifier: Apache-2.0
"""The report of a recorded flight: what it tells (story), drawn (figures), as HTML (page)."""
