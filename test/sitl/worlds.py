# SPDX-License-Identifier: Apache-2.0
"""Four vehicles: simulated ones, or SITL binaries named by environment variables."""
import os
import subprocess
import threading
import time

from uav_task_alloc.geometry.frames import Origin, to_geodetic
from uav_task_alloc.mavlink.transport.link import open_link
from uav_task_alloc.sim.config import VehicleConfig
from uav_task_alloc.sim.udp_fleet import UdpFleet

ORIGIN = Origin(47.397742, 8.545594, 488.0)
SYSTEMS = (1, 2, 3, 4)
HOMES = {n: (400.0 * n, 0.0, 0.0) for n in SYSTEMS}  # [m] ENU
SPEED = float(os.environ.get('SITL_SPEED', '3'))  # of SITL, times real time
LIMIT = float(os.environ.get('SITL_LIMIT', '900'))  # [s] wall, for each phase of a SITL flight
LAST_OUTPUT = 500  # characters of the output of an autopilot that has ended
FIRST = int(os.environ.get('SITL_FIRST_INSTANCE', '0'))
# Parameters with which a plain binary arms without a radio control: ArduCopter 4.5 and later.
COPTER_DEFAULTS = """
BATT_CAPACITY 1000000
SIM_BATT_CAP_AH 0
FRAME_CLASS 1
FRAME_TYPE 0
FS_THR_ENABLE 0
FS_GCS_ENABLE 0
DISARM_DELAY 0
ARMING_CHECK 0
INS_ACCOFFS_X 0.001
INS_ACCOFFS_Y 0.001
INS_ACCOFFS_Z 0.001
INS_ACC2OFFS_X 0.001
INS_ACC2OFFS_Y 0.001
INS_ACC2OFFS_Z 0.001
COMPASS_OFS_X 5
COMPASS_OFS_Y 13
COMPASS_OFS_Z -18
COMPASS_OFS2_X 5
COMPASS_OFS2_Y 13
COMPASS_OFS2_Z -18
"""


class ServedFleet(UdpFleet):
    """Its time passes while it is served: on a busy machine neither flies past the other."""

    TURN = 0.02  # [s] wall, at most for each turn of the bridge
    AHEAD = 1.0  # [s] vehicle time, at most, by which the bridge is ahead of the vehicles

    def __init__(self, *args):
        super().__init__(*args)
        self._clock = threading.Lock()
        self._now, self._last, self._end = 0.0, time.monotonic(), 0.0

    def serve(self):
        """The bridge has taken a turn."""
        self.now()
        with self._clock:
            self._last = time.monotonic()
            self._end = self._last + self.TURN

    def now(self):
        """Vehicle time [s]."""
        with self._clock:
            wall = min(time.monotonic(), self._end)
            later = self._now + max(0.0, wall - self._last) * self.speedup
            self._now = max(self._now, min(later, self._stepped + self.AHEAD))
            self._last = max(wall, self._last)
            return self._now


class FleetSim:
    """The simulated vehicles of this package, on one port; the bridge lives in their time."""

    speedup, limit = 20.0, 240.0

    def __init__(self, kind):
        self.kind = kind
        self.links = [open_link('udpin:127.0.0.1:0')]
        self.fleet = ServedFleet([(VehicleConfig(f'uav_{n}', n, ORIGIN, HOMES[n], arming_delay=0.0,
                                           floods=False), kind) for n in SYSTEMS],
                           ('127.0.0.1', self.links[0].port), self.speedup)
        self.thread = self.fleet.start()
        self.serve, self.now = self.fleet.serve, self.fleet.now

    def close(self):
        self.fleet.stop()
        self.thread.join()
        self.fleet.close()

    def second_links(self):
        """Links of another ground station, in the order of SYSTEMS."""
        return [open_link(f'udpout:127.0.0.1:{self.fleet.ports[f"uav_{n}"]}') for n in SYSTEMS]

    def reached(self, system):
        """Places [m] ENU at which it really reached an item; after `close`."""
        return [event.point for event in self.fleet.vehicles[f'uav_{system}'].take_events()
                if event.name == 'item_reached']


class Sitl:
    """Real autopilots from power-on, a process and a link each."""

    kind: str
    first_port: int
    speedup, limit = SPEED, LIMIT

    def __init__(self, binary, folder):
        self.binary, self.folder = os.path.abspath(binary), folder
        self.port = int(os.environ.get('SITL_PORT', self.first_port))
        self.processes = [self._start(n) for n in SYSTEMS]
        self.links = [open_link(name) for name in
                      dict.fromkeys(self.address(self.instance(n)) for n in SYSTEMS)]

    @staticmethod
    def instance(system):
        return FIRST + system - 1

    def _start(self, system):
        place = self.folder / f'sitl_{system}'
        place.mkdir()
        with open(place / 'output.txt', 'w') as output:  # PX4 makes a folder of the name `log`
            return subprocess.Popen(
                self.command(system, place), cwd=place, stdin=subprocess.DEVNULL, stdout=output,
                stderr=subprocess.STDOUT, env={**os.environ, **self.environment(system)})

    now = staticmethod(time.monotonic)

    def serve(self):
        """Fail where an autopilot has ended, as a PX4 does whose instance number is in use."""
        for system, process in zip(SYSTEMS, self.processes, strict=True):
            if process.poll() is not None:
                output = self.folder / f'sitl_{system}' / 'output.txt'
                raise AssertionError(f'vehicle {system} has ended with {process.returncode}:\n'
                                     + output.read_text('utf-8', 'replace')[-LAST_OUTPUT:])

    def close(self):
        for process in self.processes:
            process.terminate()
        for process in self.processes:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def second_links(self):
        """Links of another ground station, in the order of SYSTEMS."""
        return [open_link(self.second_address(self.instance(n))) for n in SYSTEMS]

    def reached(self, system):
        """None: the true positions are unknown."""
        return None

    def environment(self, system):
        return {}


class ArduCopter(Sitl):
    """ARDUCOPTER_SITL: build/sitl/bin/arducopter; ARDUCOPTER_DEFAULTS: a parameter file."""

    kind, first_port = 'ardupilot', 5760

    def address(self, instance):
        return f'tcp:127.0.0.1:{self.port + 10 * instance}'

    def second_address(self, instance):
        return f'tcp:127.0.0.1:{self.port + 10 * instance + 2}'

    def command(self, system, place):
        own, given = place / 'defaults.parm', os.environ.get('ARDUCOPTER_DEFAULTS', '')
        own.write_text(COPTER_DEFAULTS)
        latitude, longitude, altitude = to_geodetic(ORIGIN, HOMES[system])
        return [self.binary, '--model', '+', '--speedup', str(self.speedup), '--wipe',
                f'-I{self.instance(system)}',  # before the port, or it is added to that as well
                '--base-port', str(self.port + 10 * self.instance(system)),
                '--sysid', str(system),
                '--defaults', f'{given},{own}' if given else str(own),
                '--home', f'{latitude:.7f},{longitude:.7f},{altitude:.2f},0']


class Px4(Sitl):
    """PX4_SITL: build/px4_sitl_default/bin/px4, flown by its own simulation in hardware (SIH)."""

    kind, first_port = 'px4', 14540

    def address(self, instance):
        return f'udpin:127.0.0.1:{self.port + min(instance, 9)}'

    def second_address(self, instance):
        return f'udpout:127.0.0.1:{18570 + instance}'

    def command(self, system, place):
        etc = os.path.join(os.path.dirname(os.path.dirname(self.binary)), 'etc')
        return [self.binary, '-i', str(self.instance(system)), '-d', etc]

    def environment(self, system):
        latitude, longitude, altitude = to_geodetic(ORIGIN, HOMES[system])
        return {'PX4_SIM_MODEL': 'sihsim_quadx', 'PX4_SIM_SPEED_FACTOR': str(self.speedup),
                'PX4_HOME_LAT': f'{latitude:.7f}', 'PX4_HOME_LON': f'{longitude:.7f}',
                'PX4_HOME_ALT': f'{altitude:.2f}', 'PX4_PARAM_MAV_SYS_ID': str(system),
                'PX4_PARAM_COM_RC_IN_MODE': '4', 'PX4_PARAM_NAV_DLL_ACT': '0'}
