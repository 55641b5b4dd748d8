# SPDX-License-Identifier: Apache-2.0
"""The consensus-based bundle algorithm: agents that bid, talk to neighbours, and come to agree.

Choi, Brunet and How, Consensus-Based Decentralized Auctions for Robust Task Allocation, IEEE
Transactions on Robotics 25 (2009): phase 1 is their algorithm 3, phase 2 their table 1. An agent
knows its own score and what its neighbours tell it. Two things are added, as their authors do in
later work: equal bids are settled by the lower agent, and a bid is never above the one before it
in the bundle (Johnson, Choi and How, 2012), so that scores need not have diminishing marginal
gains. What is agreed is stable, but not always what a central greedy would choose: an agent that a
bid deterred does not build its bundle anew when that bid is withdrawn.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from uav_task_alloc.solver.routes import Floats, Ints

NOBODY = -1
Score = Callable[[Sequence[int]], tuple[Floats, Ints]]  # path -> gain of each task (n), its place
Graph = Sequence[Sequence[int]]  # neighbours of each agent


class ConsensusMessage(NamedTuple):
    """All that an agent tells its neighbours."""

    sender: int
    bid: Floats  # (n) y: highest bids it knows of
    winner: Ints  # (n) z: who made them
    heard: Ints  # (m) s: round of its latest word from each agent


class EntryAction(Enum):
    """What the receiver does to its own entry of a task."""

    LEAVE = 0
    UPDATE = 1  # take over the sender's
    RESET = 2  # to nobody


class Clash(NamedTuple):
    """Sender and receiver differ about a task."""

    higher: bool  # the sender's bid beats the receiver's
    newer: bool  # the sender has later word of whom the sender takes for the winner
    older: bool  # the receiver has
    newer_of_mine: bool  # the sender has later word of whom the receiver takes for the winner


def _update_if(wanted: bool) -> EntryAction:
    return EntryAction.UPDATE if wanted else EntryAction.LEAVE


def _rule_12(c: Clash) -> EntryAction:
    if c.newer and (c.newer_of_mine or c.higher):
        return EntryAction.UPDATE
    return EntryAction.RESET if c.newer_of_mine and c.older else EntryAction.LEAVE


# table 1: (whom the sender takes for the winner, whom the receiver) -> what the receiver does;
# 'other' is a third agent, 'same' the one that the sender means, too
RULES: Mapping[tuple[str, str], Callable[[Clash], EntryAction]] = {
    ('sender', 'receiver'): lambda c: _update_if(c.higher),
    ('sender', 'sender'): lambda c: EntryAction.UPDATE,
    ('sender', 'other'): lambda c: _update_if(c.newer_of_mine or c.higher),
    ('sender', 'nobody'): lambda c: EntryAction.UPDATE,
    ('receiver', 'receiver'): lambda c: EntryAction.LEAVE,
    ('receiver', 'sender'): lambda c: EntryAction.RESET,
    ('receiver', 'other'): lambda c: EntryAction.RESET if c.newer_of_mine else EntryAction.LEAVE,
    ('receiver', 'nobody'): lambda c: EntryAction.LEAVE,
    ('other', 'receiver'): lambda c: _update_if(c.newer and c.higher),
    ('other', 'sender'): lambda c: EntryAction.UPDATE if c.newer else EntryAction.RESET,
    ('other', 'same'): lambda c: _update_if(c.newer),
    ('other', 'other'): _rule_12,
    ('other', 'nobody'): lambda c: _update_if(c.newer),
    ('nobody', 'receiver'): lambda c: EntryAction.LEAVE,
    ('nobody', 'sender'): lambda c: EntryAction.UPDATE,
    ('nobody', 'other'): lambda c: _update_if(c.newer_of_mine),
    ('nobody', 'nobody'): lambda c: EntryAction.LEAVE,
}


class Agent:
    """One UAV's side of the protocol."""

    def __init__(self, me: int, agents: int, tasks: int, score: Score, most: int) -> None:
        self.me, self._score, self._most = me, score, most
        self.bundle: list[int] = []  # b: tasks in the order in which they were bid on
        self.path: list[int] = []  # p: the same in the order of flight
        self.bid = np.zeros(tasks)  # y
        self.winner = np.full(tasks, NOBODY, np.int64)  # z
        self.heard = np.zeros(agents, np.int64)  # s

    def build(self) -> None:
        """Phase 1: bid on the task that gains most while one can be won."""
        least = self.bid[self.bundle[-1]] if self.bundle else np.inf
        while len(self.bundle) < self._most:
            gain, place = self._score(self.path)
            offer = np.minimum(gain, least)
            wins = (offer > self.bid) | ((offer == self.bid) & (self.me < self.winner))
            wins[self.bundle] = False
            if not wins.any():
                return
            task = int(np.argmax(np.where(wins, gain, -np.inf)))
            self.bundle.append(task)
            self.path.insert(int(place[task]), task)
            self.bid[task] = least = offer[task]
            self.winner[task] = self.me

    def message(self, now: int) -> ConsensusMessage:
        """What to tell in round `now`."""
        self.heard[self.me] = now
        return ConsensusMessage(self.me, self.bid.copy(), self.winner.copy(), self.heard.copy())

    def listen(self, messages: Sequence[ConsensusMessage]) -> None:
        """Phase 2: one message after another, then let go what was lost."""
        for message in messages:
            for task in np.flatnonzero((message.winner != self.winner)
                                       | (message.bid != self.bid)):
                self._settle(int(task), message)
            np.maximum(self.heard, message.heard, out=self.heard)
        self._release()

    def _settle(self, task: int, told: ConsensusMessage) -> None:
        theirs, mine = int(told.winner[task]), int(self.winner[task])
        newer = told.heard > self.heard
        bids = told.bid[task], self.bid[task]
        clash = Clash(bool(bids[0] > bids[1] or (bids[0] == bids[1] and theirs < mine)),
                      bool(newer[theirs]), bool(told.heard[theirs] < self.heard[theirs]),
                      bool(newer[mine]))
        action = RULES[self._who(theirs, told.sender), 'same' if theirs == mine and theirs not in (
            told.sender, self.me, NOBODY) else self._who(mine, told.sender)](clash)
        if action is EntryAction.UPDATE:
            self.bid[task], self.winner[task] = told.bid[task], theirs
        elif action is EntryAction.RESET:
            self.bid[task], self.winner[task] = 0.0, NOBODY

    def _who(self, agent: int, sender: int) -> str:
        return {sender: 'sender', self.me: 'receiver', NOBODY: 'nobody'}.get(agent, 'other')

    def _release(self) -> None:
        """A lost task takes those behind it in the bundle along: their bids built on it."""
        kept = next((i for i, task in enumerate(self.bundle) if self.winner[task] != self.me),
                    len(self.bundle))
        for task in self.bundle[kept:]:
            self.path.remove(task)
            if self.winner[task] == self.me:
                self.bid[task], self.winner[task] = 0.0, NOBODY
        del self.bundle[kept:]


def one_round(agents: Sequence[Agent], graph: Graph, now: int,
              over: Callable[[], bool] = lambda: False) -> bool:
    """Both phases for all agents at once; False if nobody had anything to tell or time is over."""
    for agent in agents:
        if over():
            return False
        agent.build()
    first = agents[0]
    if all((agent.winner == first.winner).all() and (agent.bid == first.bid).all()
           for agent in agents):
        return False
    messages = [agent.message(now) for agent in agents]
    for agent in agents:
        agent.listen([messages[k] for k in graph[agent.me]])
    return True


def diameter(graph: Graph) -> int:
    """Most hops between two agents, at least 1. Raises ValueError where some cannot be reached."""
    longest = 1
    for start in range(len(graph)):
        hops, front = {start: 0}, [start]
        while front:
            agent = front.pop(0)
            new = [k for k in graph[agent] if k not in hops]
            hops.update((k, hops[agent] + 1) for k in new)
            front += new
        if len(hops) < len(graph):
            raise ValueError(f'graph = {graph}: expected all agents within reach of each other')
        longest = max(longest, *hops.values())
    return longest
