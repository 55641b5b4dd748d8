# SPDX-License-Identifier: Apache-2.0
"""The consensus-based bundle algorithm (CBBA): agents bid, exchange bids with neighbours, agree.

Choi, Brunet and How, Consensus-Based Decentralized Auctions for Robust Task Allocation, IEEE
Transactions on Robotics 25 (2009): phase 1 is their algorithm 3, phase 2 their table 1. An agent
knows its own score and the messages of its neighbours. Two rules are added, as the authors do in
later work: of equal bids that of the lower agent wins, and a bid is never above the one before it
in the bundle (Johnson, Choi and How, 2012), so that scores need not have diminishing marginal
gains. The agreement is stable, but may differ from the central greedy solution: an agent that was
outbid does not rebuild its bundle when that bid is withdrawn.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from uav_task_alloc.solver.routes import Floats, Ints

NO_AGENT = -1
Score = Callable[[Sequence[int]], tuple[Floats, Ints]]  # path -> gain of each task (n), its place
Graph = Sequence[Sequence[int]]  # neighbours of each agent


class ConsensusMessage(NamedTuple):
    """What an agent sends to its neighbours: its view of all bids."""

    sender: int
    bid: Floats  # (n) y: highest known bid of each task
    winner: Ints  # (n) z: agent of each
    updated: Ints  # (m) s: round of its latest information from each agent


class EntryAction(Enum):
    """What the receiver does with its own entry of a task."""

    LEAVE = 0
    UPDATE = 1  # copy the sender's
    RESET = 2  # to no agent


class Clash(NamedTuple):
    """How the views of sender and receiver on a task differ."""

    higher: bool  # the sender's bid beats the receiver's
    newer: bool  # the sender has later information from the winner in its view
    older: bool  # the receiver has later information from that agent
    newer_of_mine: bool  # the sender has it from the winner in the receiver's view


def _update_if(wanted: bool) -> EntryAction:
    return EntryAction.UPDATE if wanted else EntryAction.LEAVE


def _rule_12(c: Clash) -> EntryAction:
    if c.newer and (c.newer_of_mine or c.higher):
        return EntryAction.UPDATE
    return EntryAction.RESET if c.newer_of_mine and c.older else EntryAction.LEAVE


# table 1: (winner in the sender's view, in the receiver's view) -> action of the receiver;
# 'other' is a third agent, 'same' the third agent that the sender's view has
RULES: Mapping[tuple[str, str], Callable[[Clash], EntryAction]] = {
    ('sender', 'receiver'): lambda c: _update_if(c.higher),
    ('sender', 'sender'): lambda c: EntryAction.UPDATE,
    ('sender', 'other'): lambda c: _update_if(c.newer_of_mine or c.higher),
    ('sender', 'none'): lambda c: EntryAction.UPDATE,
    ('receiver', 'receiver'): lambda c: EntryAction.LEAVE,
    ('receiver', 'sender'): lambda c: EntryAction.RESET,
    ('receiver', 'other'): lambda c: EntryAction.RESET if c.newer_of_mine else EntryAction.LEAVE,
    ('receiver', 'none'): lambda c: EntryAction.LEAVE,
    ('other', 'receiver'): lambda c: _update_if(c.newer and c.higher),
    ('other', 'sender'): lambda c: EntryAction.UPDATE if c.newer else EntryAction.RESET,
    ('other', 'same'): lambda c: _update_if(c.newer),
    ('other', 'other'): _rule_12,
    ('other', 'none'): lambda c: _update_if(c.newer),
    ('none', 'receiver'): lambda c: EntryAction.LEAVE,
    ('none', 'sender'): lambda c: EntryAction.UPDATE,
    ('none', 'other'): lambda c: _update_if(c.newer_of_mine),
    ('none', 'none'): lambda c: EntryAction.LEAVE,
}


class Agent:
    """One UAV's side of the protocol."""

    def __init__(self, me: int, agents: int, tasks: int, score: Score, most: int) -> None:
        self.me, self._score, self._most = me, score, most
        self.bundle: list[int] = []  # b: tasks in the order in which they were bid on
        self.path: list[int] = []  # p: the same in the order of flight
        self.bid = np.zeros(tasks)  # y
        self.winner = np.full(tasks, NO_AGENT, np.int64)  # z
        self.updated = np.zeros(agents, np.int64)  # s

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
        """The message of round `now`."""
        self.updated[self.me] = now
        return ConsensusMessage(self.me, self.bid.copy(), self.winner.copy(), self.updated.copy())

    def receive(self, messages: Sequence[ConsensusMessage]) -> None:
        """Phase 2: process the messages in order, then release lost tasks."""
        for message in messages:
            for task in np.flatnonzero((message.winner != self.winner)
                                       | (message.bid != self.bid)):
                self._settle(int(task), message)
            np.maximum(self.updated, message.updated, out=self.updated)
        self._release()

    def _settle(self, task: int, message: ConsensusMessage) -> None:
        """Apply table 1 to a task."""
        theirs, mine = int(message.winner[task]), int(self.winner[task])
        newer = message.updated > self.updated
        bids = message.bid[task], self.bid[task]
        clash = Clash(bool(bids[0] > bids[1] or (bids[0] == bids[1] and theirs < mine)),
                      bool(newer[theirs]), bool(message.updated[theirs] < self.updated[theirs]),
                      bool(newer[mine]))
        sender, role = message.sender, self._role(mine, message.sender)
        if theirs == mine and theirs not in (sender, self.me, NO_AGENT):
            role = 'same'
        action = RULES[self._role(theirs, sender), role](clash)
        if action is EntryAction.UPDATE:
            self.bid[task], self.winner[task] = message.bid[task], theirs
        elif action is EntryAction.RESET:
            self.bid[task], self.winner[task] = 0.0, NO_AGENT

    def _role(self, agent: int, sender: int) -> str:
        return {sender: 'sender', self.me: 'receiver', NO_AGENT: 'none'}.get(agent, 'other')

    def _release(self) -> None:
        """Release lost tasks and all after them in the bundle, whose bids depended on them."""
        kept = next((i for i, task in enumerate(self.bundle) if self.winner[task] != self.me),
                    len(self.bundle))
        for task in self.bundle[kept:]:
            self.path.remove(task)
            if self.winner[task] == self.me:
                self.bid[task], self.winner[task] = 0.0, NO_AGENT
        del self.bundle[kept:]


def one_round(agents: Sequence[Agent], graph: Graph, now: int,
              is_over: Callable[[], bool] = lambda: False) -> bool:
    """Run both phases for all agents.

    Args:
        agents: all of them.
        graph: neighbours of each agent.
        now: number of the round.
        is_over: polled between agents; True ends the round.

    Returns:
        False if all views agree already, or the round was ended.
    """
    for agent in agents:
        if is_over():
            return False
        agent.build()
    first = agents[0]
    if all((agent.winner == first.winner).all() and (agent.bid == first.bid).all()
           for agent in agents):
        return False
    messages = [agent.message(now) for agent in agents]
    for agent in agents:
        agent.receive([messages[k] for k in graph[agent.me]])
    return True


def diameter(graph: Graph) -> int:
    """Diameter of the graph in hops, at least 1.

    Raises:
        ValueError: the graph is not connected.
    """
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
