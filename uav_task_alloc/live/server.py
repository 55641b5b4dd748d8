# SPDX-License-Identifier: Apache-2.0
"""Serves the live page from a board: GET only, one stream of server-sent events a page."""
from __future__ import annotations

import asyncio
import gzip
import ipaddress
import math
import socket
import threading
from collections.abc import Awaitable, Callable
from contextlib import suppress
from importlib.resources import files
from typing import Final

from aiohttp import web
from plotly.offline import get_plotlyjs

from uav_task_alloc.live.snapshot_store import SnapshotStore

TICK = 0.5  # [s] between two messages to a page
MOST_PAGES = 32  # streams at once
PAGE = {'/': ('index.html', 'text/html'), '/live.css': ('live.css', 'text/css'),
        **{f'/{name}.js': (f'{name}.js', 'text/javascript')
           for name in ('live', 'panels', 'map', 'picture')}}
LOOPBACK = ('127.0.0.1', 'localhost', '::1')
HEADERS: Final = {
    # plotly writes its own style element; no script but the files of this server is run
    'Content-Security-Policy': (
        "default-src 'none'; script-src 'self'; connect-src 'self'; img-src 'self' data:; "
        "style-src 'self' 'unsafe-inline'; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"),
    'X-Content-Type-Options': 'nosniff', 'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Resource-Policy': 'same-origin'}
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


def name_of(host: str) -> str:
    """`localhost` of `localhost:8088`, `::1` of `[::1]:8088`."""
    name = host.rsplit(':', 1)[0] if host.rpartition(':')[2].isdigit() else host
    return name.strip('[]').lower()


def is_address(name: str) -> bool:
    """Whether it is an IP address, which no foreign name server can give out as its own."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


class Server:
    """The page of one board on (host, port), in a thread of its own from `start` to `stop`.

    Raises OSError where the port is taken or the host is not of this machine.
    """

    def __init__(self, board: SnapshotStore, host: str, port: int) -> None:
        self.board = board
        self.host = host
        family = socket.AF_INET6 if ':' in host else socket.AF_INET
        self.socket = socket.create_server((host, port), family=family)
        self.port: int = self.socket.getsockname()[1]
        self.pages = 0
        self.plotly = b''  # compressed, from the first time it is asked for
        self.loop = asyncio.new_event_loop()
        self.ending = asyncio.Event()
        self.thread = threading.Thread(target=self.run, name='live page', daemon=True)

    @property
    def address(self) -> str:
        """What to type into a browser."""
        host = {'0.0.0.0': socket.gethostname(), '::': socket.gethostname()}.get(
            self.host, self.host)
        return f'http://{f"[{host}]" if ":" in host else host}:{self.port}/'

    def start(self) -> None:
        """Serve from now on."""
        self.thread.start()

    def stop(self) -> None:
        """End all streams and the thread."""
        if self.loop.is_closed():
            return
        self.loop.call_soon_threadsafe(self.ending.set)
        self.thread.join(5.0)

    def run(self) -> None:
        """The thread."""
        try:
            self.loop.run_until_complete(self.serve())
        finally:
            self.loop.close()

    async def serve(self) -> None:
        """Until `stop`."""
        app = web.Application(middlewares=[self.guard])
        app.on_response_prepare.append(add_headers)
        for path in PAGE:
            app.router.add_get(path, self.file)
        app.router.add_get('/plotly.js', self.library)
        app.router.add_get('/stream', self.stream, allow_head=False)
        app.router.add_get('/at', self.at)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
        await runner.setup()
        await web.SockSite(runner, self.socket).start()
        await self.ending.wait()
        await runner.cleanup()

    @web.middleware
    async def guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Nothing but reading, and only under a name that is ours."""
        if request.method not in ('GET', 'HEAD'):
            raise web.HTTPMethodNotAllowed(request.method, ('GET', 'HEAD'))
        if not self.is_ours(name_of(request.host)):
            raise web.HTTPForbidden(text=f'host {request.host!r}: expected {self.host}\n')
        return await handler(request)

    def is_ours(self, name: str) -> bool:
        """Whether a Host header cannot be a foreign name that was made to point here.

        On loopback only its own names; elsewhere any address, and the name of this machine.
        """
        mine = socket.gethostname().lower()
        if name in (*LOOPBACK, self.host):
            return True
        return self.host not in LOOPBACK and (is_address(name) or name in (mine, f'{mine}.local'))

    async def file(self, request: web.Request) -> web.Response:
        """A file of the page; read each time, so that a change shows after a reload."""
        name, kind = PAGE[request.path]
        text = files('uav_task_alloc.live').joinpath('page', name).read_text('utf-8')
        return web.Response(text=text, content_type=kind, headers={'Cache-Control': 'no-cache'})

    async def library(self, _: web.Request) -> web.Response:
        """plotly.js out of the Python package."""
        if not self.plotly:
            self.plotly = await asyncio.to_thread(gzip.compress, get_plotlyjs().encode(), 6)
        return web.Response(body=self.plotly, content_type='text/javascript', charset='utf-8',
                            headers={'Content-Encoding': 'gzip',
                                     'Cache-Control': 'max-age=86400'})

    async def at(self, request: web.Request) -> web.Response:
        """Everything as it was at `wall` [unix s]."""
        try:
            wall = float(request.query.get('wall', ''))
        except ValueError:
            wall = math.nan
        if math.isnan(wall):
            raise web.HTTPBadRequest(text=f'wall = {request.query.get("wall")!r}: expected '
                                          'unix seconds\n')
        return web.Response(text=self.board.at(wall), content_type='application/json')

    async def stream(self, request: web.Request) -> web.StreamResponse:
        """Everything, then twice a second what is new; a slow page is sent fewer, larger news."""
        if self.pages >= MOST_PAGES:
            raise web.HTTPServiceUnavailable(text=f'{MOST_PAGES} pages are open already\n')
        response = web.StreamResponse(headers={
            'Content-Type': 'text/event-stream', 'Cache-Control': 'no-store'})
        await response.prepare(request)
        self.pages += 1
        try:
            await response.write(b'retry: 1000\n\n')
            version = 0
            while not self.ending.is_set():
                version, text = self.board.news(version)
                await response.write(f'data: {text}\n\n'.encode())
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(self.ending.wait(), TICK)
        except ConnectionError:
            pass  # the page was closed
        finally:
            self.pages -= 1
        return response


async def add_headers(_: web.Request, response: web.StreamResponse) -> None:
    """To every answer, errors too."""
    response.headers.update(HEADERS)
