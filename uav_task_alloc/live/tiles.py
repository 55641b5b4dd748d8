# SPDX-License-Identifier: Apache-2.0
"""Map tiles of the live page: XYZ scheme, Web Mercator, from a local folder or another server."""
from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from uav_task_alloc.errors import InvalidValue

MAX_ZOOM = 22  # of any known tile server
_LOCAL_URL = 'tiles/{z}/{x}/{y}'
_SUFFIXES = {'.png': 'image/png', '.jpg': 'image/jpeg', '.jpeg': 'image/jpeg',
             '.webp': 'image/webp'}
_EXPECTED = ('a folder with {z}/{x}/{y}.png in it, or a URL that begins with http:// or '
             'https:// and has {z}, {x} and {y}')
_HOST = re.compile(r'[A-Za-z0-9.-]+(:\d+)?|\[[0-9A-Fa-f:.]+\](:\d+)?')


@dataclass(frozen=True, slots=True)
class TileSource:
    """Where the page gets its tiles from; `folder` is None for another server."""

    url: str  # template with {z}, {x} and {y}, relative to the page or absolute
    attribution: str
    min_zoom: int
    max_zoom: int
    folder: Path | None = None

    @property
    def origin(self) -> str:
        """`https://HOST` of another server, for the Content-Security-Policy; '' of a folder."""
        parts = urlsplit(self.url)
        return '' if self.folder else f'{parts.scheme}://{parts.netloc}'

    def file(self, zoom: int, column: int, row: int) -> tuple[Path, str] | None:
        """The file of a tile and its content type; None where the folder has none."""
        if self.folder is None:
            return None
        for suffix, content_type in _SUFFIXES.items():
            path = self.folder / str(zoom) / str(column) / f'{row}{suffix}'
            if path.is_file() and path.resolve().is_relative_to(self.folder):  # no link leads out
                return path, content_type
        return None


def tile_source(place: str, attribution: str = '') -> TileSource | None:
    """The source of a parameter.

    Args:
        place: a folder, or a URL template; empty: no tiles.
        attribution: text shown on the map.

    Returns:
        The source; None where `place` is empty.

    Raises:
        InvalidValue: the folder is missing or has no level of tiles, or the URL is no template.
    """
    if not place:
        return None
    if '://' in place:
        return _remote(place, attribution)
    folder = Path(place).expanduser().resolve()
    levels = [int(path.name) for path in folder.iterdir()
              if re.fullmatch('[0-9]{1,2}', path.name)] if folder.is_dir() else []
    if not levels:
        raise InvalidValue('tiles', place, _EXPECTED)
    return TileSource(_LOCAL_URL, attribution, min(levels), min(MAX_ZOOM, max(levels)), folder)


def _remote(place: str, attribution: str) -> TileSource:
    try:
        parts = urlsplit(place)
    except ValueError:
        raise InvalidValue('tiles', place, _EXPECTED) from None
    if (parts.scheme not in ('http', 'https') or not _HOST.fullmatch(parts.netloc)
            or any(f'{{{name}}}' not in place for name in 'zxy')):
        raise InvalidValue('tiles', place, _EXPECTED)
    return TileSource(place, attribution, 0, 19)
