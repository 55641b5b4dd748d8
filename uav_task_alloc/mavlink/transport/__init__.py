# SPDX-License-Identifier: Apache-2.0
"""MAVLink bytes and links: codec, sockets, connections; knows no mission."""
