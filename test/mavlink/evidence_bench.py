# SPDX-License-Identifier: Apache-2.0
"""A progress table that is fed with the positions and reports of a flight along a line."""
from mission_bench import ORIGIN

from uav_task_alloc.mavlink.autopilots import PX4 as PX4_PROFILE
from uav_task_alloc.mavlink.mission.flown_path import PositionSample
from uav_task_alloc.mavlink.mission.items import MissionStop, TaskList, mission_items
from uav_task_alloc.mavlink.mission.progress import ProgressTable
from uav_task_alloc.mavlink.transport.frame_log import FrameLog
from uav_task_alloc.model import Task

SPEED = 10.0  # [m/s]


class Flight:
    """A progress table, fed with positions at 5 Hz along x, 50 m high; 20 frames a second."""

    def __init__(self, repeats=True, plane=False):
        self.frames, self.now, self.x = FrameLog(), 0.0, 0.0
        self.lost = False  # positions
        self.table = ProgressTable(self.frames, repeats=repeats, plane=plane)
        self.stay(0.0)

    def stay(self, seconds, speed=0.0):
        for _ in range(round(5 * seconds) or 1):
            self.now += 0.2
            self.x += 0.2 * speed
            frame = self.frames.note(round(20 * self.now) % 256, self.now)
            if not self.lost:
                self.table.add_position(PositionSample(
                    self.now, (self.x, 0.0, 50.0), (speed, 0.0, 0.0)), True, self.now, frame)
            self.table.step(self.now)

    def frame(self):
        """Number of a frame sent just after the newest position."""
        return self.frames.note(round(20 * self.now + 1) % 256, self.now)

    def reached(self, seq):
        """MISSION_ITEM_REACHED, sent just after the newest position."""
        self.table.note_reached(seq, self.now, frame=self.frame())

    def fly_to(self, x):
        self.stay(abs(x - self.x) / SPEED, SPEED if x > self.x else -SPEED)

    def begin(self, service=0.0, since=None, **tasks):
        """Another mission is taken by the vehicle: tasks by name, at x [m]; since None: now."""
        stops = tuple(MissionStop(Task(name, (x, 0.0, 50.0), service_time=service))
                      for name, x in tasks.items())
        self.table.begin(mission_items(TaskList(1, stops), PX4_PROFILE.rules, ORIGIN), 0,
                         self.now, since=self.now if since is None else since)
        self.table.note_mission_mode()
