# SPDX-License-Identifier: Apache-2.0
"""Show a recorded run on the live page: `python -m uav_task_alloc.live out/demo`."""
from __future__ import annotations

import argparse
import math
from pathlib import Path

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.live.scene import Scene
from uav_task_alloc.live.snapshot_store import UPDATE_PERIOD, SnapshotStore
from uav_task_alloc.live.tiles import TileSource, tile_source
from uav_task_alloc.record.record_file import RECORD_FILE, read_lines
from uav_task_alloc.record.run_state import RunState


def play(out_dir: Path, until: float = math.inf) -> SnapshotStore:
    """The snapshots of a record.

    Args:
        out_dir: folder with record.jsonl.
        until: scenario time [s] at which to stop.

    Returns:
        The snapshots.

    Raises:
        OSError: the record cannot be read.
        InvalidValue: it is no record, or has no line.
    """
    snapshots, state = SnapshotStore(), RunState()
    scene, stored_at = Scene(state), -math.inf  # [unix s]

    def store() -> None:
        snapshots.put(state.last,
                      {'start': state.start(), 'speedup': state.scale.speedup,
                       'rate': state.scale.rate, 'live': False},
                      *scene.updates(state.last))

    path = out_dir / RECORD_FILE
    try:
        for line in read_lines(path):
            if state.tasks and state.clock(line['wall']) > until:
                break
            if line['wall'] >= stored_at + UPDATE_PERIOD:
                stored_at = line['wall']
                if state.last > -math.inf:
                    store()
            scene.apply(line)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InvalidValue('file', str(path),
                           f'a record ({type(error).__name__}: {error})') from None
    if state.last == -math.inf:
        raise InvalidValue('file', str(path), 'a record with a line at least')
    store()
    return snapshots


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='python -m uav_task_alloc.live',
        description='Show a recorded run on the live page, with a slider over its time.')
    parser.add_argument('out_dir', type=Path, help=f'a folder with {RECORD_FILE}, as a demo or '
                        'live_view with the parameter out_dir leaves')
    parser.add_argument('--host', default='127.0.0.1', help='address to serve the page on; '
                        '0.0.0.0: to the whole network, without password (%(default)s)')
    parser.add_argument('--port', type=_port, metavar='PORT', default=0,
                        help='port of the page; 0: any free one (%(default)s)')
    parser.add_argument('--tiles', default='', metavar='PLACE', help='map tiles under the fleet: '
                        'a folder with {z}/{x}/{y}.png in it, or a URL with {z}, {x} and {y} '
                        '(none)')
    parser.add_argument('--tiles-attribution', default='', metavar='TEXT',
                        help='text that the provider of the tiles wants shown')
    return parser.parse_args(argv)


def _port(text: str) -> int:
    """Read a port; `choices` of argparse would list all 65536."""
    if not text.isascii() or not text.isdigit() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f'{text!r}: expected a whole number in [0, 65535]')
    return int(text)


def serve(snapshots: SnapshotStore, host: str, port: int, tiles: TileSource | None,
          name: Path) -> None:
    """Serve a page until Ctrl-C.

    Args:
        snapshots: of the page.
        host, port: where; port 0: any free one.
        tiles: map tiles; None: none.
        name: of the run.

    Raises:
        OSError: nothing can listen there.
        ImportError: aiohttp is not installed.
    """
    from uav_task_alloc.live.server import PageServer
    server = PageServer(snapshots, host, port, tiles)
    server.start()
    print(f'Page of {name}: {server.address}   (Ctrl-C ends it)', flush=True)
    try:
        server.thread.join()
    finally:
        server.stop()


def main(argv: list[str] | None = None) -> None:
    """Serve until Ctrl-C.

    Raises:
        SystemExit: with one line, where there is no record, or no page can be served.
    """
    args = _arguments(argv)
    try:
        tiles = tile_source(args.tiles, args.tiles_attribution)
        serve(play(args.out_dir), args.host, args.port, tiles, args.out_dir)
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    except InvalidValue as error:
        raise SystemExit(str(error)) from None
    except ImportError as error:
        raise SystemExit(
            f"{error}: expected aiohttp: pip install 'uav_task_alloc[view]'") from None
    except OSError as error:
        place = error.filename or f'--host {args.host} --port {args.port}'
        raise SystemExit(f'{place}: {error.strerror}') from None


if __name__ == '__main__':
    main()
