# SPDX-License-Identifier: Apache-2.0
"""The live page: content (scene), its history (snapshot_store), HTTP server (server)."""
