# SPDX-License-Identifier: Apache-2.0
"""HTTP server of the live page: GET only, a stream of server-sent events for each page."""
from __future__ import annotations

import asyncio
import ipaddress
import json
import math
import socket
import threading
from collections.abc import Awaitable, Callable
from contextlib import suppress
from importlib.resources import files
from typing import Final

from aiohttp import web

from uav_task_alloc.live.snapshot_store import UPDATE_PERIOD, SnapshotStore
from uav_task_alloc.live.tiles import TileSource

UNANSWERED = 20_000  # [ms] after which a page that has vanished from the network frees its stream
MAX_STREAMS = 32
PAGE_FILES = {'/': ('index.html', 'text/html'), '/live.css': ('live.css', 'text/css'),
        **{f'/{name}.js': (f'{name}.js', 'text/javascript')
           for name in (
           'cards', 'chart', 'demand', 'gantt', 'geo', 'gestures', 'labels', 'layers',
           'live', 'map', 'model', 'near', 'overlay', 'panels', 'tiles', 'times')}}
LOOPBACK = ('127.0.0.1', 'localhost', '::1')
CONTENT_POLICY = (
    "default-src 'none'; script-src 'self'; connect-src 'self'; img-src 'self' data: {}; "
    "style-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'")
HEADERS: Final = {
    'X-Content-Type-Options': 'nosniff', 'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Resource-Policy': 'same-origin'}
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


def host_name(host: str) -> str:
    """`localhost` of `localhost:8088`, `::1` of `[::1]:8088`."""
    name = host.rsplit(':', 1)[0] if host.rpartition(':')[2].isdigit() else host
    return name.strip('[]').lower()


def is_ip_address(name: str) -> bool:
    """Whether a host name is an IP address."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


class PageServer:
    """Serves the page of one snapshot store in a thread of its own, from `start` to `stop`.

    Args:
        snapshots: of the page.
        host: address of this machine to listen on.
        port: 0: any free one.
        tiles: map tiles under the fleet; None: none.

    Raises:
        OSError: the port is in use, or the host is not an address of this machine.
    """

    def __init__(self, snapshots: SnapshotStore, host: str, port: int,
                 tiles: TileSource | None = None) -> None:
        self.snapshots = snapshots
        self.tiles = tiles
        self.host = host
        family = socket.AF_INET6 if ':' in host else socket.AF_INET
        self.socket = socket.create_server((host, port), family=family)
        if hasattr(socket, 'TCP_USER_TIMEOUT'):  # Linux; accepted connections inherit it
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNANSWERED)
        self.port: int = self.socket.getsockname()[1]
        self.streams = 0
        self.loop = asyncio.new_event_loop()
        self.stopping = asyncio.Event()
        self.thread = threading.Thread(target=self.run, name='live page', daemon=True)

    @property
    def address(self) -> str:
        """The URL of the page."""
        host = {'0.0.0.0': socket.gethostname(), '::': socket.gethostname()}.get(
            self.host, self.host)
        return f'http://{f"[{host}]" if ":" in host else host}:{self.port}/'

    def start(self) -> None:
        """Start the thread."""
        self.thread.start()

    def stop(self) -> None:
        """End all streams and the thread."""
        if self.loop.is_closed():
            return
        self.loop.call_soon_threadsafe(self.stopping.set)
        self.thread.join(5.0)

    def run(self) -> None:
        """The thread's function."""
        try:
            self.loop.run_until_complete(self.serve())
        finally:
            self.loop.close()

    async def serve(self) -> None:
        """Serve until `stop`."""
        app = web.Application(middlewares=[self.guard])
        app.on_response_prepare.append(self.add_headers)
        for path in PAGE_FILES:
            app.router.add_get(path, self.file)
        app.router.add_get('/tiles.json', self.tile_source)
        app.router.add_get('/tiles/{z:[0-9]{1,2}}/{x:[0-9]{1,8}}/{y:[0-9]{1,8}}', self.tile)
        app.router.add_get('/stream', self.stream, allow_head=False)
        app.router.add_get('/at', self.at)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
        await runner.setup()
        await web.SockSite(runner, self.socket).start()
        await self.stopping.wait()
        await runner.cleanup()

    @web.middleware
    async def guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse all but GET and HEAD, and foreign Host headers (DNS rebinding)."""
        if request.method not in ('GET', 'HEAD'):
            raise web.HTTPMethodNotAllowed(request.method, ('GET', 'HEAD'))
        if not self.is_own_host(host_name(request.host)):
            raise web.HTTPForbidden(text=f'host {request.host!r}: expected {self.host}\n')
        return await handler(request)

    def is_own_host(self, name: str) -> bool:
        """Whether a Host header names this machine, not a foreign name that resolves to it.

        On loopback: its own names; otherwise any IP address, and the name of this machine.
        """
        machine = socket.gethostname().lower()
        if name in (*LOOPBACK, self.host):
            return True
        return self.host not in LOOPBACK and (
            is_ip_address(name) or name in (machine, f'{machine}.local'))

    async def file(self, request: web.Request) -> web.Response:
        """A file of the page; read at each request, so that a reload shows a change."""
        name, kind = PAGE_FILES[request.path]
        text = files('uav_task_alloc.live').joinpath('page', name).read_text('utf-8')
        return web.Response(text=text, content_type=kind, headers={'Cache-Control': 'no-cache'})

    async def tile_source(self, _: web.Request) -> web.Response:
        """Where the page gets its tiles from; null: nowhere."""
        tiles = self.tiles
        return web.Response(content_type='application/json', text=json.dumps(tiles and {
            'url': tiles.url, 'attribution': tiles.attribution,
            'min_zoom': tiles.min_zoom, 'max_zoom': tiles.max_zoom}))

    async def tile(self, request: web.Request) -> web.StreamResponse:
        """A tile of the folder; 204 where there is none, which a page does not report."""
        place = (int(request.match_info[name]) for name in ('z', 'x', 'y'))
        found = self.tiles and self.tiles.file(*place)
        if not found:
            return web.Response(status=204)
        return web.FileResponse(found[0], headers={
            'Content-Type': found[1], 'Cache-Control': 'max-age=3600'})

    async def at(self, request: web.Request) -> web.Response:
        """All parts as they were at the query's `wall` [unix s]."""
        try:
            wall = float(request.query.get('wall', ''))
        except ValueError:
            wall = math.nan
        if math.isnan(wall):
            raise web.HTTPBadRequest(text=f'wall = {request.query.get("wall")!r}: expected '
                                          'unix seconds\n')
        return web.Response(text=self.snapshots.at(wall), content_type='application/json')

    async def stream(self, request: web.Request) -> web.StreamResponse:
        """All parts, then the changes twice a second; a slow page gets fewer, larger ones."""
        if self.streams >= MAX_STREAMS:
            raise web.HTTPServiceUnavailable(text=f'{MAX_STREAMS} pages are open already\n')
        response = web.StreamResponse(headers={
            'Content-Type': 'text/event-stream', 'Cache-Control': 'no-store'})
        await response.prepare(request)
        self.streams += 1
        try:
            await response.write(b'retry: 1000\n\n')
            version, stopping = 0, False
            while not stopping:
                stopping = self.stopping.is_set()  # then this is the last update
                version, text = self.snapshots.updates_since(version)
                await response.write(f'data: {text}\n\n'.encode())
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(self.stopping.wait(), UPDATE_PERIOD)
            await response.write(b'event: end\ndata: {}\n\n')  # it is no failure
        except ConnectionError:
            pass  # the page was closed
        finally:
            self.streams -= 1
        return response

    async def add_headers(self, _: web.Request, response: web.StreamResponse) -> None:
        """Add the security headers to every response, errors included."""
        response.headers.update(HEADERS)
        response.headers['Content-Security-Policy'] = CONTENT_POLICY.format(
            self.tiles.origin if self.tiles else '')
