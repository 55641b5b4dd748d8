# SPDX-License-Identifier: Apache-2.0
"""Solvers to compare with, one a file; each offers the recorder one plan or a few."""
