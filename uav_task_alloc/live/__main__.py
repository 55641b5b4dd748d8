# SPDX-License-Identifier: Apache-2.0
"""Show a recorded run on the live page: `python -m uav_task_alloc.live out/demo`."""
from __future__ import annotations

import argparse
import math
from pathlib import Path

from uav_task_alloc.live.scene import Scene
from uav_task_alloc.live.server import UPDATE_PERIOD, PageServer
from uav_task_alloc.live.snapshot_store import SnapshotStore
from uav_task_alloc.record.run_state import RECORD_FILE, RunState, read_lines


def play(out_dir: Path, until: float = math.inf) -> SnapshotStore:
    """The snapshots of a record.

    Args:
        out_dir: folder with record.jsonl.
        until: scenario time [s] at which to stop.

    Raises:
        OSError: the record cannot be read.
    """
    snapshots, state = SnapshotStore(), RunState()
    scene, stored_at = Scene(state), -math.inf  # [unix s]

    def store() -> None:
        snapshots.put(state.last,
                      {'start': state.start(), 'speedup': state.speedup, 'live': False},
                      *scene.updates(state.last))

    for line in read_lines(out_dir / RECORD_FILE):
        if state.tasks and state.clock(line['wall']) > until:
            break
        if line['wall'] >= stored_at + UPDATE_PERIOD:
            stored_at = line['wall']
            if state.last > -math.inf:
                store()
        scene.apply(line)
    store()
    return snapshots


def main(argv: list[str] | None = None) -> None:
    """Serve until Ctrl-C."""
    parser = argparse.ArgumentParser(prog='uav_task_alloc.live', description=__doc__)
    parser.add_argument('out_dir', type=Path, help='a folder with record.jsonl')
    parser.add_argument('--host', default='127.0.0.1')
    parser.add_argument('--port', type=int, default=0, help='0: any free one')
    args = parser.parse_args(argv)
    server = PageServer(play(args.out_dir), args.host, args.port)
    server.start()
    print(f'Page of {args.out_dir}: {server.address}   (Ctrl-C ends it)', flush=True)
    try:
        server.thread.join()
    except KeyboardInterrupt:
        server.stop()


if __name__ == '__main__':
    main()
