# SPDX-License-Identifier: Apache-2.0
"""Allocator, bridge and simulator of scenario_flights.py as processes in virtual time."""
from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from uav_task_alloc_msgs import msg as m

from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.allocator.status import status_of, status_of_work
from uav_task_alloc.mavlink.gcs.energy_estimate import NominalEnergy
from uav_task_alloc.mavlink.gcs.ground_station import GroundStation
from uav_task_alloc.mavlink.gcs.operator_hold import HoldRequest
from uav_task_alloc.mavlink.gcs.status import PublishedStates, state_of
from uav_task_alloc.mavlink.transport.codec import Codec, Message
from uav_task_alloc.model import Plan
from uav_task_alloc.nodes.conversions import (
    allocation_messages,
    announcements,
    bridge_messages,
    bridge_parameters,
    messages,
    orders,
)
from uav_task_alloc.nodes.fleet_sim import vehicle_config
from uav_task_alloc.params import AllocatorParams, BridgeParams, FleetSimParams
from uav_task_alloc.record import message_records
from uav_task_alloc.record.ground_truth import GroundTruth
from uav_task_alloc.scenario import Scenario
from uav_task_alloc.sim.separation_judge import Loss, SeparationJudge, TrueState
from uav_task_alloc.sim.vehicle import AUTOPILOTS, Vehicle
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.zone_codec import decode_zone_array

EPOCH = 1_700_000_000.0  # [unix s] of /clock at the start
TIMER = 0.05  # [s] of the bridge
SAMPLE, LONGEST_STEP = 0.5, 0.25  # [s] of vehicle time: between samples of the truth, of a step
ROUNDS = 60  # of bees in one solve
# wall time [s]: between two stalls of a process, of one, of the longest; each times the load
STALL_EVERY, STALL, LONGEST = 0.6, 0.12, 1.5
LATENCY, SOLVE = (0.0005, 0.004), (0.004, 0.06)  # [s] wall time of a message, of a solve


class Flight(Protocol):
    """What the processes use of the flight that they are parts of: clocks, links and topics."""

    played: Scenario
    rng: random.Random
    load: float
    wall: float  # [s]
    vehicle_time: float  # [s]

    @property
    def stamp(self) -> float:
        """The published clock [s]."""

    def to_bridge(self, n: int, frame: bytes) -> None: ...

    def to_vehicle(self, n: int, frame: bytes) -> None: ...

    def on_event(self, msg: m.TaskEvent) -> None: ...

    def on_state(self, msg: m.UavState) -> None: ...

    def on_list(self, msg: m.TaskList) -> None: ...

    def on_hold(self, msg: m.UavHold) -> None: ...

    def record(self, body: dict[str, Any]) -> None: ...


def solve(*world: object, max_iterations: int | None, **how: object) -> Plan:
    """Solve for a number of iterations, not until a time."""
    return plan(*world, max_iterations=ROUNDS if max_iterations is None else max_iterations,  # type: ignore[arg-type]
                **{**how, 'budget': 60.0})  # type: ignore[arg-type]


@dataclass
class Process:
    """When a process runs: each of its timers, and the messages that wait for it."""

    rng: random.Random
    load: float
    blocked: float = 0.0  # [s] wall time until which it stalls
    stall_at: float = 0.0  # [s] wall time
    last: float = 0.0  # [s] wall time at which the last message arrives
    inbox: deque[tuple[float, Callable[[], None]]] = field(default_factory=deque)

    def post(self, wall: float, handle: Callable[[], None]) -> None:
        """Deliver a message: `handle` is called once the process runs."""
        self.last = max(self.last, wall + self.rng.uniform(*LATENCY))
        self.inbox.append((self.last, handle))

    def runs(self, wall: float) -> bool:
        """Whether it runs at a wall time [s]; it begins a stall now and then."""
        if self.load and wall >= self.stall_at:
            self.stall_at = wall + self.rng.expovariate(1.0 / STALL_EVERY)
            self.blocked = wall + min(LONGEST, self.rng.expovariate(1.0 / STALL)) * self.load
        return wall >= self.blocked

    def take(self, wall: float) -> None:
        """Handle what has arrived, in order."""
        while self.inbox and self.inbox[0][0] <= wall:
            self.inbox.popleft()[1]()


class Fleet:
    """The simulated vehicles, and their log as the judge reads it."""

    def __init__(self, run: Flight) -> None:
        self.run, played = run, run.played
        self.vehicles = {uav.system_id: Vehicle(
            vehicle_config(uav, played, FleetSimParams()), AUTOPILOTS[uav.autopilot])
            for uav in played.uavs}
        self.codecs = {n: (Codec(n, 1), Codec(n, 1)) for n in self.vehicles}
        self.judge = SeparationJudge(played.separation.horizontal, played.separation.vertical)
        self.truth = GroundTruth(simulated=True)
        self.sample_at = self.stepped = 0.0

    def receive(self, n: int, frame: bytes) -> None:
        """A frame from the bridge."""
        for message in self.codecs[n][1].parse(frame):
            self.send(n, self.vehicles[n].receive(message, self.stepped))

    def send(self, n: int, sent: list[Message]) -> None:
        for message in sent:
            self.run.to_bridge(n, self.codecs[n][0].pack(message))

    def step(self) -> None:
        """Make up for what was not stepped, as UdpFleet does."""
        steps = max(1, math.ceil((self.run.vehicle_time - self.stepped) / LONGEST_STEP))
        begun, share = self.stepped, (self.run.vehicle_time - self.stepped) / steps
        for k in range(1, steps + 1):
            self.step_to(begun + k * share)
        self.stepped = self.run.vehicle_time

    def step_to(self, now: float) -> None:
        """Step all vehicles, and log."""
        for n, vehicle in self.vehicles.items():
            self.send(n, vehicle.step(now))
        begun, ended = self.judge.step(now, {
            each.config.uav: TrueState(each.flight.body.position, each.flight.home,
                                       not each.flight.landed and not each.silent)
            for each in self.vehicles.values()})
        self.log_losses('separation_lost', begun)
        self.log_losses('separation_regained', ended)
        for vehicle in self.vehicles.values():
            for event in vehicle.take_events():
                self.log(vehicle, event.t, event.point, event=event.name)
            if now >= self.sample_at:
                self.log(vehicle, now, vehicle.flight.body.position, alive=not vehicle.silent)
        if now >= self.sample_at:
            self.sample_at = now + SAMPLE

    def log(self, vehicle: Vehicle, t: float, point: tuple[float, float, float],
            **more: object) -> None:
        x, y, z = point
        self.truth.apply({'uav': vehicle.config.uav, 'clock': EPOCH + t,
                          'x': x, 'y': y, 'z': z, **more})

    def log_losses(self, event: str, losses: list[Loss]) -> None:
        for loss in losses:
            self.truth.apply({'event': event, 'uav': loss.uavs[0], 'other': loss.uavs[1],
                              'clock': EPOCH + loss.nearest.t,
                              'horizontal': loss.nearest.horizontal,
                              'vertical': loss.nearest.vertical})

    def kill(self, uav: str) -> None:
        """Lose a vehicle."""
        next(each for each in self.vehicles.values() if each.config.uav == uav).kill()


class Bridge:
    """What the bridge's node does with its ground station."""

    def __init__(self, run: Flight, params: BridgeParams) -> None:
        self.run, self.params = run, params
        self.config = bridge_parameters.to_gcs_config(params)
        self.limits = bridge_parameters.to_uav_limits(params.uav_limits)
        self.full_ranges = bridge_parameters.to_full_ranges(params.full_ranges)
        self.station = GroundStation(self.config, random.Random(run.rng.random()))
        self.codecs = {uav.system_id: (Codec(params.system_id, params.component_id),
                                       Codec(params.system_id, params.component_id))
                       for uav in run.played.uavs}
        self.published, self.zones, self.zones_known = PublishedStates(), (), False
        self.expires: dict[tuple[str, str], float] = {}
        self.timer_at = self.heartbeat_at = 0.0
        self.log = deque[str](maxlen=20_000)

    def receive(self, n: int, frame: bytes) -> None:
        """A frame from a vehicle."""
        for message in self.codecs[n][1].parse(frame):
            self.send(self.station.receive(n, message, self.run.wall))

    def send(self, out: list[tuple[Any, Message]]) -> None:
        for n, message in out:
            self.run.to_vehicle(n, self.codecs[n][0].pack(message))

    def step(self) -> None:
        """A step of the protocols, and of the timer where it is due."""
        run, wall = self.run, self.run.wall
        self.send(self.station.step(wall))
        if wall >= self.timer_at:
            self.timer_at = wall + TIMER
            policy = bridge_parameters.to_policy(self.params, self.zones, '', run.stamp,
                                                 zones_known=self.zones_known)
            for session in self.station.sessions.values():
                session.executor.policy = policy
            for (uav, source), expires in self.expires.items():
                if run.stamp >= expires:
                    self.expires[uav, source] = math.inf
                    self.station.hold(uav, HoldRequest(source, False), wall)
        for session in list(self.station.sessions.values()):
            self.publish(session)

    def publish(self, session: Any) -> None:
        """Publish the events and the state of a UAV."""
        run, executor, uav = self.run, session.executor, session.uav_id
        while executor.events:
            run.on_event(bridge_messages.from_progress(uav, executor.events.popleft(), run.stamp))
        while executor.notes:
            note = executor.notes.popleft()
            self.log.append(f'{run.stamp - EPOCH:8.2f} {uav} {note.level}: {note.text}')
        executor.energy.nominal = NominalEnergy(
            self.full_ranges.get(uav, self.params.full_range),
            self.limits.get(uav, {}).get('endurance', 0.0),
            self.limits.get(uav, {}).get('cruise_speed', 0.0))
        status = state_of(session, run.wall)
        measured_at, rate = executor.telemetry.position_at, executor.telemetry.clock_rate.value
        if self.published.is_due(status, measured_at, run.wall, self.params.state_rate):
            rate = rate if math.isfinite(rate) else 1.0
            run.on_state(bridge_messages.from_uav_status(
                status, (), run.stamp - rate * (run.wall - measured_at), self.limits.get(uav)))

    def on_list(self, msg: m.TaskList) -> None:
        """A task list; as on the topic, only the newest that waits is flown."""
        self.send(self.station.assign(msg.uav_id, bridge_messages.to_list(
            msg, msg.uav_id, self.config.origin, self.params.acceptance_radius), self.run.wall))

    def on_hold(self, msg: m.UavHold) -> None:
        request = orders.to_hold_request(msg, msg.uav_id)
        expires = orders.hold_expiry(msg, self.run.stamp)
        if request.hold and expires <= self.run.stamp:
            request = HoldRequest(request.source, False)
        self.expires[msg.uav_id, request.source] = expires if request.hold else math.inf
        self.station.hold(msg.uav_id, request, self.run.wall)

    def on_zones(self, msg: m.ThreatZoneArray) -> None:
        self.zones, refusal = bridge_messages.to_zones(msg, self.zones)
        assert not refusal, refusal
        self.zones_known = True


class AllocatorProcess:
    """What the allocator's node does with its core."""

    def __init__(self, run: Flight, params: AllocatorParams) -> None:
        self.run, self.params = run, params
        self.core = Allocator(params, 0.0)
        self.core.set_kernels_ready()
        self.world = self.core.world
        self.answer: Any = None
        self.answer_at = math.inf  # [s] wall time

    def step(self) -> None:
        """A step, and the answer of the worker where there is one."""
        run, wall = self.run, self.run.wall
        if wall >= self.answer_at:
            self.answer_at = math.inf
            self.core.adopt(self.answer, wall, run.stamp)
        self.core.tick(wall, run.stamp)
        problem = self.core.due(wall, run.stamp)
        if problem is not None:
            self.answer = planning.solve_problem(solve, problem, self.world.params, lambda: False)
            self.answer_at = wall + run.rng.uniform(*SOLVE) * (1.0 + run.load)
        step = self.core.separate(wall, run.stamp)
        for hold in step.holds:
            run.on_hold(orders.from_separation_hold(hold))
        outbox = self.core.collect()
        self.core.written(self.core.rows())
        for uav, operator in outbox.holds.items():
            assert uav == operator.uav
            run.on_hold(orders.from_hold(operator))
        for each in outbox.lists.values():
            run.on_list(allocation_messages.from_list(each))
        if outbox.statuses:
            run.record(message_records.statuses_record(allocation_messages.from_statuses(
                self.statuses(), run.stamp)))
        if outbox.allocation is not None:
            run.record(message_records.allocation_record(allocation_messages.from_allocation(
                outbox.allocation, list(map(allocation_messages.from_list,
                                            outbox.allocation.lists)), self.statuses())))

    def statuses(self) -> list[m.TaskStatus]:
        """The statuses of all tasks, as AllocationPublisher makes them."""
        works, expected = self.world.works, self.world.deadlines.expected
        return list(map(allocation_messages.from_task_status, (
            *(status_of_work(works, work, expected) for work in works.records.values()),
            *(status_of(name, record, expected.get(name, 0.0))
              for name, record in self.world.task_records().items()))))

    def on_event(self, msg: m.TaskEvent) -> None:
        self.world.event(messages.to_event(msg), self.run.stamp, self.run.wall)

    def on_state(self, msg: m.UavState) -> None:
        self.world.update_uav(messages.to_report(msg), self.run.wall, self.run.stamp)

    def on_tasks(self, msg: m.TaskAnnouncement) -> None:
        verdicts = announcements.announce(self.world, msg, self.run.played.origin,
                                          self.run.stamp, self.run.wall)
        assert all(verdict.accepted for verdict in verdicts), verdicts

    def on_zones(self, msg: m.ThreatZoneArray) -> None:
        zones, invalid = decode_zone_array(msg)
        self.world.set_zones(zones, invalid, self.run.wall)
