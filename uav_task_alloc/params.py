# SPDX-License-Identifier: Apache-2.0
"""All parameters, declared once; ROS descriptors, YAML files and docs are generated from them."""
from __future__ import annotations

import math
from dataclasses import dataclass

from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.parameter_field import CheckedParams, param

MAX_RANGE = 1e7  # [m]
_MAX_PRICE = 1e9  # of an objective
_RULES = (3, 4)  # prices that may be infinite: lateness, unserved


@dataclass(frozen=True)
class FrameParams(CheckedParams):
    """The origin of the ENU frame; the same for all nodes of a fleet."""

    origin__latitude: float = param(47.397742, 'Origin of the ENU frame.', low=-90.0, high=90.0,
                                    unit='deg', fixed=True)
    origin__longitude: float = param(8.545594, 'Origin of the ENU frame.', low=-180.0,
                                     high=180.0, unit='deg', fixed=True)
    origin__altitude_amsl: float = param(488.0, 'Origin of the ENU frame above mean sea level.',
                                         low=-500.0, high=9000.0, unit='m', fixed=True)


@dataclass(frozen=True)
class AllocatorParams(FrameParams):
    """allocator: plans for the UAVs, tasks and zones reported, publishes a list for each UAV."""

    solve_budget: float = param(0.1, 'Solve time of one replan.', low=0.001, high=60.0, unit='s')
    route_end: str = param('home', 'What a UAV does after its tasks.', choices=('hold', 'home'))
    uav_timeout: float = param(5.0, 'Silence after which the tasks of a UAV go to the others.',
                               low=0.1, high=3600.0, unit='s')
    default_range: float = param(20000.0, 'Range of a UAV that does not report its own.', low=0.0,
                                 high=MAX_RANGE, unit='m')
    default_cruise_speed: float = param(15.0, 'Speed of a UAV that does not report its own.',
                                        low=0.1, high=1000.0, unit='m/s')
    default_climb_speed: float = param(2.5, 'Climb speed of a UAV that does not report its own.',
                                       low=0.1, high=1000.0, unit='m/s')
    default_descent_speed: float = param(1.5, 'Descent speed of a UAV that does not report its '
                                         'own.', low=0.1, high=1000.0, unit='m/s')
    objective: str = param('balanced', 'What a plan minimises, see docs/times.md.',
                           choices=('distance', 'finish', 'response', 'balanced'))
    objective_weights: tuple[float, ...] = param(
        (), 'Prices of distance, finish, response, lateness and tasks left out that replace '
        'those of the objective; .inf: never. Empty: by its name.')
    anticipate: str = param(
        'off', 'Where an idle UAV in flight waits: where it is; spread evenly; where tasks came '
        'from. See docs/learning.md.', choices=('off', 'even', 'learnt'))
    anticipate_area: tuple[float, ...] = param(
        (), 'The area of work for that: west, south, east, north [m] ENU; empty: around the '
        'tasks so far.')
    trips: int = param(1, 'Trips of a UAV that a plan counts on, with battery changes at its '
                       'home between them; 1: none.', low=1, high=64)
    clearance: float = param(10.0, 'Distance kept from zones beyond their margins.', low=0.0,
                             high=10000.0, unit='m')
    altitude_min: float = param(0.0, 'Lowest detour, above the origin.', low=-1e5, high=1e5,
                                unit='m')
    altitude_max: float = param(1e5, 'Highest detour, above the origin.', low=-1e5, high=1e5,
                                unit='m')
    fence_area: tuple[str, ...] = param(
        (), 'Corners `LATITUDE,LONGITUDE` of the area that no plan leaves; empty: none.',
        fixed=True)
    terrain: str = param('', 'GeoTIFF of the ground, heights above mean sea level; empty: none.',
                         fixed=True)
    terrain_clearance: float = param(30.0, 'Distance that legs keep from the ground of '
                                     '`terrain`.', low=0.0, high=10000.0, unit='m')
    settle: float = param(0.05, 'Quiet time that ends a burst of events; one solve a burst.',
                          low=0.0, high=10.0, unit='s')
    replan_margin: float = param(0.01, 'Share of its cost by which a plan must be better to '
                                 'replace the one that is flown; what tasks have waited already '
                                 'does not count.', low=0.0, high=1.0)
    background_budget: float = param(0.05, 'Time of one search between events; 0: none.',
                                     low=0.0, high=10.0, unit='s')
    background_period: float = param(
        0.5, 'Pause between two such searches.', low=0.05, high=3600.0, unit='s')
    list_interval: float = param(0.25, 'Minimum time between two lists for one UAV, unless it '
                                 'cannot fly the first.', low=0.0, high=3600.0, unit='s')
    locked_tasks: int = param(1, 'Tasks of a list that stay with a UAV in flight: the active '
                              'one, and those after it; 0: it may be diverted until it has '
                              'reached its task.', low=0, high=1000)
    battery_reserve: float = param(0.2, 'Battery that no plan uses: a UAV turns home while it '
                                   'lasts for the way home and this.', low=0.0, high=0.9)
    position_jump: float = param(200.0, 'Distance between two reports above which the jump is '
                                 'logged and replanned for.', low=1.0, high=1e7, unit='m')
    max_attempts: int = param(3, 'UAVs that may fail at a task before it is FAILED.', low=1,
                              high=1000)
    keep_ended: int = param(10_000, 'Ended tasks that are kept, the newest; an older one that is '
                            'announced again is a new task.', low=0, high=1_000_000)
    approval: str = param('none', 'Which plans wait for an operator: none; those that change the '
                          'list of a UAV with tasks; all. What is safety never waits.',
                          choices=('none', 'replan', 'all'))
    approval_timeout: float = param(30.0, 'Time after which a plan that waits is decided without '
                                    'an operator.', low=1.0, high=86400.0, unit='s')
    approval_on_timeout: str = param(
        'reject', 'How it is decided then.', choices=('accept', 'reject'))
    separation__horizontal: float = param(
        0.0, 'Distance that keeps two UAVs apart; 0: off.', low=0.0, high=1000.0, unit='m')
    separation__vertical: float = param(
        5.0, 'Height that does so at any distance.', low=0.1, high=1000.0, unit='m')
    separation__time: float = param(
        2.0, 'By which a UAV may be early or late.', low=0.0, high=60.0, unit='s')
    state_dir: str = param('', 'Folder of the journal; empty: nothing is stored.', fixed=True)
    threads: int = param(1, 'Colonies of bees, each in its own thread.', low=1, high=64)
    seed: int = param(0, 'Seed of the bees.', low=0, high=2**31 - 1, fixed=True)

    def __post_init__(self) -> None:
        FrameParams.__post_init__(self)
        prices = self.objective_weights
        if len(prices) not in (0, 5) or (prices and not any(prices)) or not all(
                0.0 <= price <= _MAX_PRICE or (price == math.inf and number in _RULES)
                for number, price in enumerate(prices)):
            raise InvalidValue('objective_weights', list(prices),
                               f'five numbers in [0, {_MAX_PRICE:g}] (distance, finish, response, '
                               'lateness, unserved), the last two also .inf, not all 0; or none')
        area = self.anticipate_area
        if area and not (len(area) == 4 and max(map(abs, area)) <= MAX_RANGE
                         and area[0] < area[2] and area[1] < area[3]):
            raise InvalidValue('anticipate_area', list(area),
                               'west < east and south < north [m], or none')
        if self.altitude_min >= self.altitude_max:
            raise InvalidValue('altitude_min', self.altitude_min,
                               f'less than altitude_max = {self.altitude_max:g}')


@dataclass(frozen=True)
class BridgeParams(FrameParams):
    """mavlink_bridge: flies the task lists on ArduPilot and PX4 and reports progress."""

    connections: tuple[str, ...] = param(
        ('udpin:0.0.0.0:14550',), 'udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or '
        '/dev/tty...:BAUD each.', fixed=True)
    system_ids: tuple[int, ...] = param((), 'Systems to bridge; empty: all that send heartbeats.',
                                        fixed=True)
    uav_id_pattern: str = param('uav_{sysid}', 'The uav_id of a system.', fixed=True)
    autopilot: str = param('auto', 'Type of the autopilot; auto: from its heartbeat.',
                           choices=('auto', 'ardupilot', 'px4', 'generic'), fixed=True)
    cruise_altitude: float = param(50.0, 'Height above home to take off to.', low=1.0,
                                   high=5000.0, unit='m')
    acceptance_radius: float = param(0.0, 'Of a task that has none of its own; 0: 2 m on '
                                     'PX4 copters, else the autopilot decides.',
                                     low=0.0, high=1000.0, unit='m')
    takeoff: bool = param(False, 'Arm and take off automatically.')
    signing_key_file: str = param('', 'File with the signing key; empty: unsigned.', fixed=True)
    system_id: int = param(245, 'MAVLink system id of the bridge; not that of the ground '
                           'station of a pilot.', low=1, high=255, fixed=True)
    component_id: int = param(190, 'MAVLink component id of the bridge.', low=1, high=255,
                              fixed=True)
    when_empty: str = param('hold', 'What a UAV in flight does with an empty list.',
                            choices=('hold', 'return'))
    when_foreign: str = param('yield', 'A mission of another station is left, or replaced.',
                              choices=('yield', 'reassert'))
    fences: str = param('off', 'Zones as fences on board; require: no take-off without them.',
                        choices=('off', 'warn', 'require'))
    fence_area: tuple[str, ...] = param(
        (), 'Corners `LATITUDE,LONGITUDE` of the area that all stay in, with `fences` also by a '
        'fence on board; empty: none.', fixed=True)
    rally_points: tuple[str, ...] = param(
        (), 'Places to return to, `LATITUDE,LONGITUDE[,HEIGHT above home]`.', fixed=True)
    relaunch: str = param('operator', 'Who starts a UAV after its list or a low battery: '
                          '`~/hand_over`, or the bridge.', choices=('operator', 'automatic'))
    state_dir: str = param('', 'Folder for authority, holds and fences; empty: none.', fixed=True)
    capabilities: tuple[str, ...] = param((), 'What UAVs can do, `uav_1:camera`.', fixed=True)
    full_range: float = param(0.0, 'Range of a full battery, until a flight shows it; 0: unknown.',
                              low=0.0, high=MAX_RANGE, unit='m')
    full_ranges: tuple[str, ...] = param(
        (), 'The same for single UAVs that differ, `uav_1:6000` each.', fixed=True)
    uav_limits: tuple[str, ...] = param(
        (), 'More about single UAVs, SI: cruise_speed, climb_speed, descent_speed, endurance when '
        'full, turnaround, payload_capacity, hold_radius; `uav_1:endurance=900`.', fixed=True)
    state_rate: float = param(10.0, 'Maximum rate of the states of one UAV.', low=0.5, high=100.0,
                              unit='Hz')
    tlog: str = param('', 'File to record all frames into, as .tlog; empty: none.', fixed=True)


@dataclass(frozen=True)
class FleetSimParams(CheckedParams):
    """fleet_sim: simulated ArduPilot and PX4 vehicles that speak MAVLink over UDP."""

    scenario: str = param('', 'Scenario file with the origin and the UAVs.', fixed=True)
    speedup: float = param(1.0, 'How many times faster than real time.', low=0.1, high=100.0,
                           fixed=True)
    target: str = param('127.0.0.1:14550', 'HOST:PORT of the bridge, UDP.', fixed=True)
    log_file: str = param('', 'File for the ground truth, a JSON object a line; empty: none.',
                          fixed=True)
    arming_delay: float = param(-1.0, 'Time from boot to a position estimate; negative: that of '
                                'the real autopilots.', low=-1.0, high=3600.0, unit='s',
                                fixed=True)
    climb_rate: float = param(0.0, 'Of vehicles whose scenario states none; 0: that of the '
                              'autopilots, 2.5 (ArduCopter) and 3 m/s (PX4).', low=0.0,
                              high=100.0, unit='m/s', fixed=True)
    descent_rate: float = param(0.0, 'The same downwards; 0: 1.5 m/s.', low=0.0, high=100.0,
                                unit='m/s', fixed=True)
    max_airspeed: float = param(0.0, 'Largest speed through the air, at the limit of the lean '
                                'angle; 0: 1.3 times the cruise speed.', low=0.0, high=1000.0,
                                unit='m/s', fixed=True)
    wind_east: float = param(0.0, 'Wind towards east, added to that of the scenario.', low=-100.0,
                             high=100.0, unit='m/s', fixed=True)
    wind_north: float = param(0.0, 'The same towards north.', low=-100.0, high=100.0, unit='m/s',
                              fixed=True)
    gusts: float = param(0.0, 'Standard deviation of gusts in each direction; the larger of this '
                         'and that of the scenario counts.', low=0.0, high=100.0, unit='m/s',
                         fixed=True)
    clock: bool = param(True, 'Publish /clock: simulated time, by which nodes with use_sim_time '
                        'live.', fixed=True)


@dataclass(frozen=True)
class PlayerParams(CheckedParams):
    """scenario_player: announces the tasks and zones of a scenario file at their times."""

    scenario: str = param('', 'Scenario file to play.', fixed=True)
    speedup: float = param(1.0, 'How many times faster than real time; with use_sim_time /clock '
                           'decides.', low=0.1, high=100.0, fixed=True)
    wait_for_plan: bool = param(False, 'Start when an allocator has published a first plan: its '
                                'kernels are compiled, and UAVs report.', fixed=True)
    clock: bool = param(False, 'Publish /clock where no other node does, such as fleet_sim; not '
                        'with use_sim_time.', fixed=True)


@dataclass(frozen=True)
class LiveViewParams(CheckedParams):
    """live_view: shows a fleet in the terminal and the browser, and records it."""

    scenario: str = param('', 'Scenario that is played; empty: unknown, and no end.', fixed=True)
    speedup: float = param(0.0, 'How many times faster than real time the fleet flies; 0: '
                           'measured by the clocks of its vehicles, which the bridge reports.',
                           low=0.0, high=100.0, fixed=True)
    out_dir: str = param('', 'Folder to record into; empty: nothing is recorded.', fixed=True)
    record: str = param('', 'MCAP file for every topic of the fleet, also as `--record FILE`; '
                        'empty: none.', fixed=True)
    settle: float = param(10.0, 'Quiet time after the end of the scenario before the node exits.',
                          low=0.0, high=3600.0, unit='s', fixed=True)
    stay: bool = param(False, 'Keep running when the scenario is over.', fixed=True)
    page: bool = param(True, 'Serve a page for the browser.', fixed=True)
    host: str = param('127.0.0.1', 'Address the page is served on; 0.0.0.0: to the whole network, '
                      'without password.', fixed=True)
    port: int = param(8088, 'Port of the page; 0: any free one, logged at the start.', low=0,
                      high=65535, fixed=True)
    tiles: str = param('', 'Map tiles under the fleet (XYZ, Web Mercator): a folder with '
                       '{z}/{x}/{y}.png in it, or a URL with {z}, {x} and {y} that the browser '
                       'loads them from; empty: none.', fixed=True)
    tiles_attribution: str = param('', 'Text that the provider of the tiles wants shown.',
                                   fixed=True)


NODES: dict[str, type[CheckedParams]] = {
    'allocator': AllocatorParams, 'mavlink_bridge': BridgeParams, 'fleet_sim': FleetSimParams,
    'scenario_player': PlayerParams, 'live_view': LiveViewParams,
}
