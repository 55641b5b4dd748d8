# SPDX-License-Identifier: Apache-2.0
"""One battery: its estimate, fed by its per cent and, where it is measured, the charge used."""
from __future__ import annotations

import math

from uav_task_alloc.mavlink.gcs.charge_count import ChargeCount
from uav_task_alloc.mavlink.gcs.energy_estimate import EnergyEstimate, NominalEnergy


class BatteryEnergy:
    """The estimate of one battery and the count of its charge.

    Args:
        nominal: what is stated about the vehicle.
    """

    def __init__(self, nominal: NominalEnergy) -> None:
        self.estimate, self.count = EnergyEstimate(nominal), ChargeCount()

    @property
    def doubt(self) -> str:
        """Why per cent and charge used disagree, and which counts; '': they agree."""
        return self.count.doubt

    @property
    def text(self) -> str:
        """What is left, and how it is known."""
        how = (f'by the charge used, of {self.count.used_capacity:.0f} mAh'
               if self.estimate.counting else 'by its per cent')
        return f'{100.0 * max(0.0, self.estimate.charge):.1f} % {how}'

    def took_off(self) -> None:
        """Begin a flight."""
        self.estimate.took_off()
        self.count.took_off()

    def read(self, share: float, used: float, capacity: float, now: float) -> None:
        """Process a report of the battery.

        Args:
            share: its per cent [0..1].
            used: charge counted since any moment [mAh]; NaN or 0: not measured.
            capacity: [mAh]; NaN: not known.
            now: [s], of a clock that runs as that of the vehicle.
        """
        estimate, count = self.estimate, self.count
        before = count.used_capacity if estimate.counting else math.nan
        count.capacity = capacity
        counted = count.read(share, used, now)
        if not count.counts:
            estimate.counting = False
        elif not estimate.counting:
            estimate.start_counting()
        else:
            if before != count.used_capacity:
                estimate.scale(before / count.used_capacity)
            if counted is not None:
                estimate.count(counted.share, counted.deviation)
        estimate.read(share, count.per_cent_believed)
