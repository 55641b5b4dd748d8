# SPDX-License-Identifier: Apache-2.0
"""Reproducible experiments: the paper's study, the benchmark, ablations."""
