# SPDX-License-Identifier: Apache-2.0
"""Configuration of a simulated vehicle, its flight modes and its ground-truth events."""
from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from uav_task_alloc.geometry.frames import Origin
from uav_task_alloc.model import Point
from uav_task_alloc.sim.wind import Wind


@dataclass(frozen=True, slots=True)
class VehicleConfig:
    """Configuration of one vehicle; None is the value of the real autopilot."""

    uav: str  # id, in the ground truth
    system_id: int  # 1..255
    origin: Origin  # of the ENU frame
    position: Point  # [m] ENU on the ground, at the start
    home: Point | None = None  # [m] ENU; None: the position
    cruise_speed: float = 15.0  # [m/s]
    climb_rate: float = 4.0  # [m/s] upwards
    descent_rate: float = 4.0  # [m/s] downwards
    acceleration: float = 3.0  # [m/s2]
    range: float = math.inf  # [m] through the air at cruise speed with a full battery
    endurance: float = math.inf  # [s] in the air with a full battery
    charge: float = 1.0  # of the battery at the start
    turnaround: float = math.inf  # [s] of a battery change at home; infinite: none
    wind: Wind | None = None  # None: calm
    max_airspeed: float | None = None  # [m/s] at the largest lean; None: 1.3 times cruise_speed
    acceptance_radius: float | None = None  # [m] WPNAV_RADIUS, NAV_ACC_RAD
    arming_delay: float | None = None  # [s] from power-up to a position estimate
    boot_delay: float | None = None  # [s] from power-up to the end of the boot
    settling_time: float | None = None  # [s] for which the first position estimate jumps
    batteries: int = 1  # 1 or 2
    second_battery: float = 0.7  # what remains in it, as a share of what remains in the first
    battery_capacity: float = 5000.0  # [mAh] of each battery, whatever its parameter says
    current_sensors: int = 2  # number of batteries, the first ones, whose current is measured
    capacity: int | None = None  # items of the mission storage
    floods: bool = True  # PX4 streams its onboard set unasked
    # PX4 sends mission_state and mission_mode: not 1.15 and before, whose are always 0
    reports_mission_state: bool = False
    fence_capacity: int | None = None  # points of the fence store; 0: none at all
    parameters: tuple[tuple[str, float], ...] = ()  # those that differ from the defaults


class FlightMode(Enum):
    """What the vehicle does; `modes` maps the custom modes of each autopilot to these.

    MANUAL is flown by the pilot's stick, and so is HOLD on ArduCopter (LOITER): without a radio
    control it sinks there.
    """

    MANUAL = 'manual'
    MISSION = 'mission'
    GUIDED = 'guided'
    HOLD = 'hold'
    BRAKE = 'brake'
    TAKEOFF = 'takeoff'
    RETURN = 'return'
    LAND = 'land'
    OTHER = 'other'  # any that hovers here, such as CIRCLE or OFFBOARD


class StorageChange(Enum):
    """Change of the stored mission, reported to the flight that uses it."""

    TRUNCATED = 'truncated'
    WRITTEN = 'written'
    REPLACED = 'replaced'
    CLEARED = 'cleared'


@dataclass(frozen=True, slots=True)
class TruthEvent:
    """An event on board, for the ground-truth log.

    Names: armed, disarmed, takeoff, item_reached, mission_end, died, mode, command, crashed,
    reboot, failsafe, failsafe_over, kill_switch, kill_switch_off, glitch, power_off,
    battery_changed; of the payload photo, trigger, video on, video off, servo, gripper, gimbal,
    roi on, roi off, speed, yaw, with the values in `command`. Causes: `station
    SYSTEM/COMPONENT`, pilot, failsafe, self; of a failsafe its kind.
    """

    t: float  # [s] vehicle time
    name: str
    point: Point  # [m] ENU: of the item's target as stored, else of the vehicle
    seq: int | None = None  # mission item: item_reached, and a command to set the current one
    mode: int | None = None  # custom_mode: mode, and a command to change it
    cause: str = ''  # of mode, armed, disarmed, crashed, command, failsafe
    command: str = ''  # arm, disarm, forced arm, forced disarm, mode, takeoff, ...
