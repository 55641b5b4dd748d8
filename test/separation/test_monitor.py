# SPDX-License-Identifier: Apache-2.0
"""Who holds for whom: UAVs that fly their ways and obey holds, judged by their true distances."""
import math
from dataclasses import replace

import pytest

from uav_task_alloc.separation.monitor import AlertAction, MonitoredUav, SeparationMonitor
from uav_task_alloc.separation.prediction import Way
from uav_task_alloc.separation.rule import Separation

RULE = Separation(10.0, 5.0, 2.0)
DT, DELAY, BRAKING = 0.1, 0.8, 3.0  # [s], [s] until a hold is flown, [m/s2]


class Craft:
    """Flies from point to point, and obeys holds after a delay."""

    def __init__(self, *points, speed=15.0, claim=1.0, late=0.0, obeys=True, stops_at=None):
        self.points, self.cruise, self.claim = list(points), speed, claim
        self.place, self.speed, self.obeys = self.points.pop(0), speed, obeys
        self.orders, self.held, self.late, self.stops_at = [], False, late, stops_at

    def fly(self, now):
        while self.orders and self.orders[0][0] <= now:
            self.held = self.orders.pop(0)[1]
        stopped = self.held or not self.points or (
            self.stops_at is not None and now >= self.stops_at)
        goal = 0.0 if stopped else self.cruise
        step = BRAKING * DT
        self.speed += max(-step, min(step, goal - self.speed))
        rest = self.speed * DT
        while rest > 1e-9 and self.points:
            far = math.dist(self.place, self.points[0])
            share = min(1.0, rest / far) if far else 1.0
            self.place = tuple(p + share * (q - p)
                               for p, q in zip(self.place, self.points[0], strict=True))
            rest -= far * share
            if share == 1.0:
                self.points.pop(0)

    def monitored(self, holding):
        points, clock, place = [(0.0, self.place)], 0.0, self.place
        for point in self.points:
            clock += math.dist(place, point) / self.cruise
            points.append((clock, point))
            place = point
        if not self.obeys:  # where its velocity takes it
            if self.speed < 0.5 or not self.points:
                points = points[:1]
            return MonitoredUav(Way(tuple(points), self.speed), (9.0,), False, 'a pilot flies it')
        return MonitoredUav(Way(tuple(points), self.speed), (self.claim,))


def lost(a, b, rule=RULE):
    return (math.dist(a.place[:2], b.place[:2]) < rule.horizontal
            and abs(a.place[2] - b.place[2]) < rule.vertical)


def fly(crafts, seconds=120.0, on=True, replan=None):
    """Fly; returns losses, alerts, ids that held, and whether all held at once."""
    monitor, losses, alerts, held = SeparationMonitor(), set(), [], []
    for k in range(int(seconds / DT)):
        now = k * DT
        if on and k % 5 == 0:
            step = monitor.step(now, {n: c.monitored(n in monitor.holding)
                                      for n, c in crafts.items()}, RULE)
            alerts += step.alerts
            for hold in step.holds:
                crafts[hold.uav].orders.append((now + DELAY, hold.hold))
            held.append(frozenset(monitor.holding))
            for pair in step.unresolved if replan else ():
                replan(pair)
        for craft in crafts.values():
            craft.fly(now)
        losses |= {(a, b) for a in crafts for b in crafts if a < b and lost(crafts[a], crafts[b])}
    return losses, alerts, held


def crossing(**more):
    return {'a': Craft((-300, 0, 50), (300, 0, 50), claim=1.0, **more),
            'b': Craft((0, -300, 50), (0, 300, 50), claim=2.0)}


def test_without_the_monitor_the_scenes_have_losses():
    assert fly(crossing(), on=False)[0] == {('a', 'b')}


def test_of_two_that_cross_the_one_with_the_lesser_claim_holds_and_goes_on():
    crafts = crossing()
    losses, alerts, held = fly(crafts)
    assert not losses
    assert set().union(*held) == {'a'}
    assert [alert.action for alert in alerts] == [
        AlertAction.NONE, AlertAction.HOLD, AlertAction.RELEASE]
    assert alerts[1].holder == 'a'
    assert 'a holds for b' in alerts[1].text
    assert not crafts['a'].points
    assert not crafts['b'].points


def test_a_uav_that_does_not_obey_keeps_its_way():
    crafts = {'a': Craft((-300, 0, 50), (300, 0, 50), claim=5.0),
              'b': Craft((0, -300, 50), (0, 300, 50), obeys=False)}
    losses, _, held = fly(crafts)
    assert not losses
    assert set().union(*held) == {'a'}
    assert not crafts['a'].points


def test_a_renewed_hold_lasts_at_most_a_minute_each():
    monitor = SeparationMonitor()
    def at(place, *more):
        return Way(((0.0, place), *more), 0.0)
    uavs = {'a': MonitoredUav(Way(((0.0, (0, 0, 50)), (4.0, (60, 0, 50))), 15.0), (1.0,)),
            'b': MonitoredUav(at((60, 0, 50)), (9.0,), False, 'a pilot flies it')}
    holds = []
    for k in range(200):
        holds += monitor.step(0.5 * k, uavs, RULE).holds
    assert all(0.0 < hold.expires - hold.stamp <= 60.0 for hold in holds)
    assert [hold.stamp for hold in holds] == [0.0, 20.0, 40.0, 60.0, 80.0]
    gone = monitor.step(100.0, {'a': uavs['a']}, RULE)
    assert [(hold.uav, hold.hold) for hold in gone.holds] == [('a', False)]


def test_four_that_meet_at_one_place_never_wait_for_each_other():
    crafts = {name: Craft(start, tuple(-v for v in start[:2]) + (50,), claim=claim)
              for claim, (name, start) in enumerate(zip('abcd', [
                  (-300, 5, 50), (4, -310, 50), (-200, 240, 50), (260, 170, 50)], strict=True))}
    losses, _, held = fly(crafts, 200.0)
    assert not losses
    assert all(len(each) < 4 for each in held)
    assert not any(craft.points for craft in crafts.values())


def head_on():
    return {'a': Craft((-300, 0, 50), (300, 0, 50), claim=1.0),
            'b': Craft((300, 0, 50), (-300, 0, 50), claim=2.0)}


def test_head_on_both_stop_before_they_collide_which_is_said_as_unresolved():
    losses, alerts, _ = fly(head_on())
    assert not losses
    assert any(alert.action is AlertAction.UNRESOLVED for alert in alerts)


def test_one_that_would_stop_beside_one_that_comes_down_goes_on():
    rule = Separation(30.0, 10.0, 2.0)
    down = Way(((0.0, (0, 0, 46.9)), (31.3, (0, 0, 0))), pad=(0, 0, 0))
    home = Way(((0.0, (20, 4, 34.0)), (1.0, (18, 0, 34.0)), (23.7, (18, 0, 0))), 4.0,
               pad=(18, 0, 0))
    uavs = {'down': MonitoredUav(down, (5.0,), False, 'down lands'),
            'home': MonitoredUav(home, (3.0,), early=True)}
    step = SeparationMonitor().step(0.0, uavs, rule)
    assert [alert.action for alert in step.alerts] == [AlertAction.UNRESOLVED]
    assert 'to stop makes it no better' in step.alerts[0].reason
    assert not step.holds


def test_head_on_the_first_whose_way_a_new_plan_frees_goes_on_and_then_the_other():
    crafts = head_on()

    def replan(pair):
        x, y, z = crafts['b'].place
        crafts['b'].points = [(x, y, z + 20), (-300, 0, 70)]
    losses, _, _ = fly(crafts, replan=replan)
    assert not losses
    assert not crafts['a'].points
    assert not crafts['b'].points


def test_one_that_overtakes_on_the_same_track_waits():
    crafts = {'a': Craft((-400, 0, 50), (600, 0, 50), speed=20.0, claim=2.0),
              'b': Craft((-300, 0, 50), (600, 30, 50), speed=8.0, claim=1.0)}
    losses, _, _ = fly(crafts, 300.0)
    assert not losses


@pytest.mark.parametrize('stops_at', [8.0, 14.0, 17.0])
def test_one_that_stops_in_mid_leg_is_not_run_into(stops_at):
    crafts = {'a': Craft((-300, 0, 50), (300, 0, 50), claim=1.0),
              'b': Craft((0, -300, 50), (0, 300, 50), obeys=False, stops_at=stops_at)}
    losses, _alerts, _ = fly(crafts)
    assert not losses


def test_a_hold_of_a_fixed_wing_takes_the_room_of_its_circle():
    way = Way(((0.0, (0, 0, 50)), (30.0, (450, 0, 50))), 15.0, hold_radius=80.0)
    other = Way(((0.0, (80, 100, 50)), (20.0, (80, -200, 50))), 15.0)
    monitor = SeparationMonitor()
    step = monitor.step(0.0, {'plane': MonitoredUav(way, (1.0,)),
                              'copter': MonitoredUav(other, (2.0,))}, RULE)
    assert [hold.uav for hold in step.holds] == ['copter']


def test_one_that_waits_beside_a_climb_is_not_released_and_held_in_one_step():
    climb = [(2.0 * k, (0.0, 0.0, 36.0 + 5.0 * k)) for k in range(7)]
    uavs = {'a': MonitoredUav(Way(((0.0, (11.4, 0.0, 46.0)), (30.0, (-48.6, 0.0, 46.0)))),
                               early=True),
            'b': MonitoredUav(Way(tuple(climb)), (5.0,), False, 'takes off')}
    monitor = SeparationMonitor()
    assert [hold.hold for hold in monitor.step(0.0, uavs, RULE).holds] == [True]
    for k in range(1, 24):
        now = 0.5 * k
        ahead = tuple((t - now, place) for t, place in climb if t > now)
        uavs['b'] = replace(uavs['b'], way=Way(((0.0, (0.0, 0.0, 36.0 + 2.5 * now)), *ahead)))
        assert len(monitor.step(now, uavs, RULE).holds) <= 1


def test_one_on_the_ground_takes_off_when_its_way_is_free():
    up = Way(((0.0, (0, 0, 0)), (2.0, (0, 0, 0)), (22.0, (0, 0, 50)), (40.0, (270, 0, 50))),
             on_ground=True, pad=(0, 0, 0))
    down = Way(((0.0, (40, 0, 40)), (3.0, (4, 0, 40)), (28.0, (4, 0, 0))), 12.0, pad=(4, 0, 0))
    monitor = SeparationMonitor()
    step = monitor.step(0.0, {'up': MonitoredUav(up, (0.0,)),
                              'down': MonitoredUav(down, (5.0,))}, RULE)
    assert [(hold.uav, hold.hold) for hold in step.holds] == [('up', True)]
    for now in (0.5, 1.0):
        step = monitor.step(now, {'up': MonitoredUav(up, (0.0,))}, RULE)
    assert not monitor.holding


def test_without_a_rule_nobody_holds():
    monitor = SeparationMonitor()
    uavs = {n: MonitoredUav(Way(((0.0, (x, 0, 50)),)), (x,)) for n, x in (('a', 0), ('b', 1))}
    assert monitor.step(0.0, uavs, RULE).alerts
    step = monitor.step(0.5, uavs, Separation())
    assert not monitor.holding
    assert not step.unresolved


@pytest.mark.parametrize('beside', [0.0, 3.0])
def test_one_that_comes_down_on_one_that_is_too_near_already_stops(beside):
    """4.5 m above, where 5 m are required, and down through it: nearer in height alone."""
    crafts = {'a': Craft((0, 0, 50)), 'b': Craft((beside, 0, 54.5), (beside, 0, 0), speed=0.3)}
    _, _, held = fly(crafts, 60.0)
    assert 'b' in held[-1]
    assert crafts['b'].place[2] > 53.0


def test_two_that_are_too_near_already_may_fly_apart_while_one_comes_down():
    crafts = {'a': Craft((0, 0, 50)), 'b': Craft((6, 0, 54.0), (36, 0, 40), speed=5.0)}
    _, _, held = fly(crafts, 30.0)
    assert not set().union(*held)
    assert not crafts['b'].points
