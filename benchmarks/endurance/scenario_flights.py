# SPDX-License-Identifier: Apache-2.0
"""Flies a scenario in virtual time with processes that stall at random, as on a loaded machine.

Run: `python benchmarks/endurance/scenario_flights.py --flights 20 --seed 1 --json`, where ROS is
sourced. Allocator, solver, ground station, simulated vehicles and messages are the real ones; only
their clocks and their transport are virtual. Allocator, bridge and simulator each stall now and
then, `--load` times the usual, and the messages to them wait. The judge is that of `report`, by
the simulator's log. The last line is JSON; the status is 1 where a task was lost, one was flown
twice, a zone was entered, separation was lost, or a flight did not end.
"""
from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import random
import sys
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from uav_task_alloc_msgs import msg as m

from uav_task_alloc import scenario
from uav_task_alloc.allocator import Allocator
from uav_task_alloc.allocator.replanning import planning
from uav_task_alloc.allocator.status import status_of, status_of_work
from uav_task_alloc.cli.report import run_summary
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
from uav_task_alloc.params import AllocatorParams, BridgeParams, FleetSimParams, LiveViewParams
from uav_task_alloc.record import message_records
from uav_task_alloc.record.ground_truth import GroundTruth
from uav_task_alloc.record.progress import run_is_over
from uav_task_alloc.record.run_state import RunState
from uav_task_alloc.sim.separation_judge import Loss, SeparationJudge, TrueState
from uav_task_alloc.sim.vehicle import AUTOPILOTS, Vehicle
from uav_task_alloc.solver.solve import plan
from uav_task_alloc.zone_codec import decode_zone_array

SCENARIO = Path(__file__).resolve().parents[2] / 'config/scenarios/survey.yaml'
EPOCH = 1_700_000_000.0  # [unix s] of /clock at the start
TICK, STEP, TIMER = 0.02, 0.025, 0.05  # [s] of the simulator and links, allocator, bridge's timer
SAMPLE, LONGEST_STEP = 0.5, 0.25  # [s] of vehicle time: between samples of the truth, of a step
ROUNDS = 60  # of bees in one solve
LIMIT = 1500.0  # [s] of the scenario
# wall time [s]: between two stalls of a process, of one, of the longest; each times the load
STALL_EVERY, STALL, LONGEST = 0.6, 0.12, 1.5
LATENCY, SOLVE = (0.0005, 0.004), (0.004, 0.06)  # [s] wall time of a message, of a solve
FAULTS = ('tasks_lost', 'tasks_flown_twice', 'zone_violations', 'separation_losses', 'not_over')


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

    def __init__(self, run: Run) -> None:
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

    def __init__(self, run: Run, params: BridgeParams) -> None:
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

    def __init__(self, run: Run, params: AllocatorParams) -> None:
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


class Run:
    """One flight of a scenario; `fly` returns its summary."""

    def __init__(self, played: scenario.Scenario, seed: int, load: float) -> None:
        self.played, self.load, self.rng = played, load, random.Random(seed)
        self.wall = self.vehicle_time = 0.0
        self.started_at: float | None = None  # [s] of vehicle time
        self.moments = deque(scenario.timeline(played))
        self.parts = {name: Process(random.Random(self.rng.random()), load)
                      for name in ('fleet', 'bridge', 'allocator')}
        given = scenario.simulation_parameters(played, SCENARIO, 14550)
        self.fleet = Fleet(self)
        self.bridge = Bridge(self, params_of(BridgeParams, given['mavlink_bridge']))
        self.allocator = AllocatorProcess(self, params_of(AllocatorParams, {
            **given['allocator'], 'seed': seed}))
        self.state = RunState()
        self.record({'kind': 'run', 'speedup': played.speedup, 'simulated': True})
        self.record({'kind': 'origin', **asdict(played.origin)})

    @property
    def stamp(self) -> float:
        """The published clock [s]."""
        return EPOCH + self.vehicle_time

    def record(self, body: dict[str, Any]) -> None:
        self.state.apply({'wall': self.stamp, **body})

    # links and topics

    def to_bridge(self, n: int, frame: bytes) -> None:
        self.parts['bridge'].post(self.wall, partial(self.bridge.receive, n, frame))

    def to_vehicle(self, n: int, frame: bytes) -> None:
        self.parts['fleet'].post(self.wall, partial(self.fleet.receive, n, frame))

    def on_event(self, msg: m.TaskEvent) -> None:
        self.parts['allocator'].post(self.wall, partial(self.allocator.on_event, msg))

    def on_state(self, msg: m.UavState) -> None:
        self.parts['allocator'].post(self.wall, partial(self.allocator.on_state, msg))
        self.record(message_records.state_record(msg))

    def on_list(self, msg: m.TaskList) -> None:
        self.parts['bridge'].post(self.wall, partial(self.bridge.on_list, msg))
        self.record(message_records.task_list_record(msg))

    def on_hold(self, msg: m.UavHold) -> None:
        self.parts['bridge'].post(self.wall, partial(self.bridge.on_hold, msg))

    # the scenario

    def play(self) -> None:
        """Announce what is due; the scenario begins once all vehicles are there."""
        if self.started_at is None:
            if len(self.allocator.world.fleet.records) < len(self.played.uavs):
                return
            self.started_at = self.vehicle_time
        while self.moments and self.moments[0].at <= self.vehicle_time - self.started_at:
            moment = self.moments.popleft()
            if moment.zones is not None:
                zones = messages.from_zones(moment.zones, self.stamp)
                for name, part in (('bridge', self.bridge), ('allocator', self.allocator)):
                    self.parts[name].post(self.wall, partial(part.on_zones, zones))
                self.record(message_records.zones_record(zones))
            if moment.works:
                works = [replace(work, task=scenario.from_zero(
                    work.task, EPOCH + self.started_at)) for work in moment.works]
                msg = messages.announcement(m.TaskAnnouncement.ADD, works, self.stamp)
                self.parts['allocator'].post(self.wall, partial(self.allocator.on_tasks, msg))
                self.record(message_records.announcement_record(msg, self.played.origin))
            for uav in moment.deaths:
                self.fleet.kill(uav)

    def fly(self) -> dict[str, Any]:
        """Fly until the scenario is over; its figures and faults."""
        over_since = math.inf
        due = dict.fromkeys(self.parts, 0.0)
        steps = {'fleet': (self.fleet.step, TICK), 'bridge': (self.bridge.step, TICK),
                 'allocator': (self.allocator.step, STEP)}
        for k in count():
            self.wall = k * 0.005
            if self.parts['fleet'].runs(self.wall):
                self.vehicle_time = self.wall * self.played.speedup
            for name, (step, period) in steps.items():
                if self.parts[name].runs(self.wall):
                    if self.wall >= due[name]:
                        due[name] = self.wall + period
                        step()
                    self.parts[name].take(self.wall)
            self.play()
            now = self.vehicle_time - (self.started_at or 0.0)
            if k % 20 == 0:
                over = not self.moments and run_is_over(self.state, self.played, now)
                over_since = min(over_since, now) if over else math.inf
            if now >= min(over_since + LiveViewParams.settle, LIMIT):
                break
        self.fleet.log_losses('least_distance', [
            Loss(pair, nearest, nearest.t) for pair, nearest in self.fleet.judge.least.items()])
        return {**run_summary(self.state, self.fleet.truth), 'not_over': int(now >= LIMIT)}


def params_of(kind: type[Any], given: dict[str, Any]) -> Any:
    """The parameters of a node from those by ROS name."""
    rows = {key.replace('.', '__'): tuple(value) if isinstance(value, list) else value
            for key, value in given.items()}
    return kind(**{key: value for key, value in rows.items()
                   if key in kind.__dataclass_fields__})


def fly(path: Path, load: float, seed: int) -> dict[str, Any]:
    """Fly a scenario once; its figures."""
    return Run(scenario.load(path), seed, load).fly()


def main() -> int:
    """Fly, print, judge."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n')[0])
    parser.add_argument('--scenario', type=Path, default=SCENARIO)
    parser.add_argument('--flights', type=int, default=10)
    parser.add_argument('--seed', type=int, default=1, help='of the first flight')
    parser.add_argument('--load', type=float, default=1.0, help='0: no stalls')
    parser.add_argument('--workers', type=int, default=2)
    parser.add_argument('--json', action='store_true', help='only the last line')
    args = parser.parse_args()
    began, totals, least = time.monotonic(), Counter[str](), math.inf
    seeds = range(args.seed, args.seed + args.flights)
    with multiprocessing.get_context('spawn').Pool(args.workers) as pool:
        for seed, found in zip(seeds, pool.imap(partial(fly, args.scenario, args.load), seeds),
                               strict=True):
            totals.update({name: int(found[name]) for name in (
                *FAULTS, 'tasks_announced', 'tasks_completed', 'tasks_unassigned', 'uploads')})
            least = min(least, found['separation_min_m'] or math.inf)
            if not args.json:
                named = {name: found[name] for name in (*FAULTS, 'lost', 'flown_twice', 'entries',
                                                        'losses') if found[name]}
                print(f'{seed}: {found["tasks_completed"]} of {found["tasks_announced"]}, '
                      f'{found["finish_s"]:.0f} s, {found["metres_flown"]:.0f} m, '
                      f'{found["uploads"]} uploads, {found["separation_min_m"]} m {named or ""}',
                      flush=True)
    print(json.dumps({'flights': args.flights, 'load': args.load, 'seed': args.seed, **totals,
                      'separation_min_m': least, 'wall_s': round(time.monotonic() - began)}))
    return int(any(totals[name] for name in FAULTS))


if __name__ == '__main__':
    sys.exit(main())
