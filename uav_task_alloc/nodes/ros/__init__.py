# SPDX-License-Identifier: Apache-2.0
"""What nodes share: parameters, running, subscriptions, publishers, recording."""
