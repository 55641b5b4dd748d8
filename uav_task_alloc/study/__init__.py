# SPDX-License-Identifier: Apache-2.0
"""Experiments that anyone can repeat: the paper's study, the bench against rivals, ablations."""
