# SPDX-License-Identifier: Apache-2.0
"""Shows a recorded run on the live page: `python -m uav_task_alloc.live out/demo`."""
from __future__ import annotations

import argparse
import math
from pathlib import Path

from uav_task_alloc.live.scene import Scene
from uav_task_alloc.live.server import TICK, Server
from uav_task_alloc.live.snapshot_store import SnapshotStore
from uav_task_alloc.record import run_state as heard


def play(out_dir: Path, until: float = math.inf) -> SnapshotStore:
    """The board as it stood at the end of a record, or `until` [s] after its first task."""
    board, said = SnapshotStore(), heard.RunState()
    scene, put = Scene(said), -math.inf

    def post() -> None:
        board.put(said.last, {'start': said.start(), 'speedup': said.speedup, 'live': False},
                  *scene.news(said.last))

    for line in heard.read_lines(out_dir / heard.FILE):
        if said.tasks and said.clock(line['wall']) > until:
            break
        if line['wall'] >= put + TICK:
            put = line['wall']
            if said.last > -math.inf:
                post()
        scene.take(line)
    post()
    return board


def main(argv: list[str] | None = None) -> None:
    """Serve until Ctrl-C."""
    parser = argparse.ArgumentParser(prog='uav_task_alloc.live', description=__doc__)
    parser.add_argument('out_dir', type=Path, help='a folder with record.jsonl')
    parser.add_argument('--host', default='127.0.0.1')
    parser.add_argument('--port', type=int, default=0, help='0: any free one')
    args = parser.parse_args(argv)
    server = Server(play(args.out_dir), args.host, args.port)
    server.start()
    print(f'Page of {args.out_dir}: {server.address}   (Ctrl-C ends it)', flush=True)
    try:
        server.thread.join()
    except KeyboardInterrupt:
        server.stop()


if __name__ == '__main__':
    main()
