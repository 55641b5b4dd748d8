# SPDX-License-Identifier: Apache-2.0
"""Baseline solvers, one a file; each offers the recorder one plan or several."""
