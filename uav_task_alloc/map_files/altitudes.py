# SPDX-License-Identifier: Apache-2.0
"""Heights above the origin of map elements, whose altitudes refer to sea level or the origin."""
from __future__ import annotations

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.map_files.elements import (
    ABOVE_ORIGIN,
    AMSL,
    UNSAID,
    Element,
    MapFileError,
    Place,
)
from uav_task_alloc.map_files.property_values import number_in

_HIGHEST = 1e6  # [m] of an altitude
_REFERENCES = {'altitude': ABOVE_ORIGIN, 'altitude_amsl': AMSL}  # of properties


class Altitudes:
    """Heights of elements above an origin.

    Args:
        origin: of the scenario.
        unsaid: what altitudes refer to where a file does not say: `amsl`, `origin` or `ignore`;
            '': such a file is refused.
    """

    def __init__(self, origin: Origin, unsaid: str) -> None:
        self._origin, self._unsaid = origin, unsaid

    def height(self, element: Element, place: Place, without: float) -> float:
        """Return the height of a place of an element.

        Args:
            element: its properties come before the altitude of the place.
            place: one of its places.
            without: [m] where neither says it.

        Returns:
            [m] above the origin.

        Raises:
            MapFileError: an altitude is no number, is there twice, or does not say above what.
        """
        own = {key: element.properties[key] for key in _REFERENCES
               if str(element.properties.get(key, '')).strip()}
        if len(own) > 1:
            raise MapFileError(f'{element.where}: {" and ".join(own)}: expected one of them')
        if own:
            key, given = next(iter(own.items()))
            number = number_in(given)
            if not isinstance(number, (int, float)) or not abs(number) <= _HIGHEST:
                raise MapFileError(f'{element.where}: {key} = {given!r}: expected a number [m]')
            return self._above_origin(number, _REFERENCES[key])
        if place.altitude is None or not element.reference:
            return without
        if element.reference != UNSAID:
            return self._above_origin(place.altitude, element.reference)
        if self._unsaid == 'ignore' or (place.altitude == 0.0 and not self._unsaid):
            return without
        if not self._unsaid:
            raise MapFileError(
                f'{element.where}: altitude {place.altitude:g}, and the file does not say above '
                'what: expected --altitudes amsl, origin or ignore')
        return self._above_origin(place.altitude, self._unsaid)

    def _above_origin(self, altitude: float, reference: str) -> float:
        return altitude - self._origin.altitude_amsl if reference == AMSL else altitude
