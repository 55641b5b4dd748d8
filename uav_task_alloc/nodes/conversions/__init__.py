# SPDX-License-Identifier: Apache-2.0
"""Messages to model values and back, with the limits of what a message may hold."""
