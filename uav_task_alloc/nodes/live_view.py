# SPDX-License-Identifier: Apache-2.0
"""Shows a fleet in the terminal and in the browser, records it, ends when a scenario is over."""
from __future__ import annotations

import json
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from uav_task_alloc_msgs import msg as m

from uav_task_alloc import scenario
from uav_task_alloc.errors import InvalidValue
from uav_task_alloc.live.scene import Scene
from uav_task_alloc.live.snapshot_store import SnapshotStore
from uav_task_alloc.model import is_ros_name
from uav_task_alloc.nodes.conversions.message_limits import cut
from uav_task_alloc.nodes.conversions.messages import ANNOUNCEMENTS, LATCHED, STATES
from uav_task_alloc.nodes.ros.parameters import declare
from uav_task_alloc.nodes.ros.run import run, with_flags
from uav_task_alloc.nodes.ros.topic_names import TASK_LIST, check_topic
from uav_task_alloc.params import LiveViewParams
from uav_task_alloc.record import message_records as lines
from uav_task_alloc.record.progress import fleet, headline, is_over
from uav_task_alloc.record.run_state import FILE, RunState

REFRESH = 0.5  # [s] in a terminal
PLAIN_EVERY = 4  # refreshes between two lines where the output is no terminal
MOST_REFUSED = 200  # lines of the log
UP_AND_CLEAR = '\x1b[{}F\x1b[J'


class LiveView(Node):
    """Listens to everything, says nothing on any topic. `--record FILE`: all of it as MCAP."""

    def __init__(self) -> None:
        super().__init__('live_view')
        self.params = declare(self, LiveViewParams).now
        self.played = scenario.load(self.params.scenario) if self.params.scenario else None
        self.origin = self.played.origin if self.played else scenario.values.DEFAULT_ORIGIN
        self.heard = RunState()
        self.refused: set[tuple[str, str]] = set()  # topic and why, as logged
        self.scene, self.board = Scene(self.heard), SnapshotStore()
        self.file = self._open()
        self.recorder = self._record()
        self.finished = False
        self.quiet_since: float | None = None  # [s] of the scenario
        self.shown = 0  # lines to write over
        self.refreshes = 0
        self.take({'wall': time.time(), 'kind': 'run', 'speedup': self.params.speedup})
        self.server = self._serve()
        self.listen()
        self.create_timer(REFRESH, self.refresh)

    def listen(self) -> None:
        """Subscribe to what is recorded; lists follow as UAVs become known."""
        for kind, topic, qos, read in (
            (m.TaskAnnouncement, 'task_announcements', ANNOUNCEMENTS,
             lambda msg: lines.announced_tasks(msg, self.origin)),
            (m.ThreatZoneArray, 'threat_zones', LATCHED, lines.announced_zones),
            (m.TaskStatusArray, 'task_statuses', LATCHED, lines.statuses),
            (m.Allocation, 'allocation', ANNOUNCEMENTS, lines.allocation_record),
            (DiagnosticArray, '/diagnostics', 10, lines.uploads),
        ):
            self.create_subscription(kind, topic, self.taking(topic, read), qos)
        self.create_subscription(m.UavState, 'uav_states', self.on_state, STATES)
        for uav in self.played.uavs if self.played else ():
            self.follow(uav.id)

    def follow(self, uav: str) -> None:
        """Listen to the task lists of one UAV."""
        self.heard.lists[uav] = {'tasks': [], 'distance': 0.0}
        try:
            topic = check_topic(self, TASK_LIST, uav)
        except InvalidValue as error:  # the rest of what it says is shown all the same
            return self.refuse('task_list', error)
        self.create_subscription(
            m.TaskList, topic, self.taking(topic, lines.task_list_record), LATCHED
        )

    def on_state(self, msg: m.UavState) -> None:
        """As `take_state`, whatever the message brings."""
        self.guarded('uav_states', lambda: self.take_state(msg))

    def take_state(self, msg: m.UavState) -> None:
        """Record a state where something but the position is new, else twice a second."""
        if not is_ros_name(msg.uav_id):
            return  # has no topic of lists; the allocator says what is wrong with it
        if msg.uav_id not in self.heard.lists:
            self.follow(msg.uav_id)
        line = {'wall': time.time(), **lines.state(msg)}
        old = self.heard.uavs.get(msg.uav_id)
        what = ('mode', 'mission_state', 'active', 'list_revision', 'available', 'authority',
                'reason')
        if old is None or line['wall'] - old['wall'] >= REFRESH or any(
                line[key] != old[key] for key in what):
            self.take(line)

    def taking(self, topic: str, read: Callable[[Any], lines.RecordBody]) -> Callable[[Any], None]:
        """A callback that records what `read` makes of a message."""
        return lambda msg: self.guarded(
            topic, lambda: self.take({'wall': time.time(), **read(msg)}))

    def guarded(self, topic: str, take: Callable[[], None]) -> None:
        """Take one message; one that is bad is refused, and no more."""
        try:
            take()
        except Exception as error:
            self.refuse(topic, error)

    def refuse(self, topic: str, error: Exception) -> None:
        """Log what is wrong with a message, each fault of a topic once."""
        why = str(error) if isinstance(error, InvalidValue) else cut(
            f'{type(error).__name__}: {error}')
        if len(self.refused) < MOST_REFUSED and (topic, why) not in self.refused:
            self.refused.add((topic, why))
            self.get_logger().warning(f'{topic}: {why}: ignored; said once')

    def take(self, line: lines.RecordBody) -> None:
        """Fold a line into what is known, and write it down."""
        self.scene.take(line)
        if self.file:
            self.file.write(json.dumps(line) + '\n')

    def refresh(self) -> None:
        """Show where things are; note when they have been over for long enough."""
        clock = self.clock()
        if self.played is None or not is_over(self.heard, self.played, clock):
            self.quiet_since = None
        else:
            self.quiet_since = clock if self.quiet_since is None else self.quiet_since
            self.finished = (not self.params.stay
                             and clock - self.quiet_since >= self.params.settle)
        self.show(clock)
        self.post()
        if self.file:
            self.file.flush()

    def post(self) -> None:
        """Put what is new on the page."""
        wall = time.time()
        news = self.scene.news(wall)
        if self.server:
            self.board.put(wall, {'start': self.heard.start(), 'live': True,
                                  'speedup': self.heard.speedup}, *news)

    def clock(self) -> float:
        """Scenario time [s]: since the first task was announced."""
        return self.heard.clock(time.time()) if self.heard.tasks else 0.0

    def show(self, clock: float) -> None:
        """Write over the lines of last time; in a file, one line now and then."""
        self.refreshes += 1
        lines = [headline(self.heard, clock)]
        if sys.stdout.isatty():
            lines += fleet(self.heard, time.time())
            width = shutil.get_terminal_size().columns - 1  # a line that wraps cannot be undone
            lines = [line[:width] for line in lines]
            sys.stdout.write(UP_AND_CLEAR.format(self.shown) if self.shown else '')
            self.shown = len(lines)
        elif self.refreshes % PLAIN_EVERY and not self.finished:
            return
        print('\n'.join(lines), flush=True)

    def _open(self) -> Any:
        if not self.params.out_dir:
            return None
        folder = Path(self.params.out_dir)
        folder.mkdir(parents=True, exist_ok=True)
        return (folder / FILE).open('w', encoding='utf-8')

    def _serve(self) -> Any:
        """The page in the browser; None, and a word why, where there can be none."""
        if not self.params.page:
            return None
        try:
            from uav_task_alloc.live.server import Server
            server = Server(self.board, self.params.host, self.params.port)
        except (OSError, ImportError) as error:
            self.get_logger().warning(
                f'no live page: host = {self.params.host}, port = {self.params.port}: {error}')
            return None
        server.start()
        print(f'Live page: {server.address}', flush=True)
        return server

    def _record(self) -> Any:
        """Everything into an MCAP file, where one is named."""
        if not self.params.record:
            return None
        try:
            from uav_task_alloc.nodes.ros.bag_recorder import BagRecorder
            recorder = BagRecorder(Path(self.params.record), self.get_namespace(), {
                'speedup': str(self.params.speedup),
                **({f'origin.{name}': str(value) for name, value in asdict(
                    self.played.origin).items()} if self.played else {})})
        except (OSError, ImportError) as error:
            raise InvalidValue('record', self.params.record,
                               f'a file that can be written ({error})') from None
        recorder.start()
        return recorder

    def destroy_node(self) -> None:
        """End the page, close the records."""
        if self.server:
            self.server.stop()
        if self.recorder:
            self.recorder.stop()
        if self.file:
            self.file.close()
            self.file = None
        super().destroy_node()


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run(LiveView, with_flags(args or sys.argv, 'record'))
