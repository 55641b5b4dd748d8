# SPDX-License-Identifier: Apache-2.0
"""What a run leaves on disk: what the nodes said (heard) and where the vehicles were (truth)."""
