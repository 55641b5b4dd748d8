# SPDX-License-Identifier: Apache-2.0
"""The plan that waits for an operator: opened, replaced, decided, and not proposed again."""
from __future__ import annotations

from dataclasses import replace

from uav_task_alloc.allocator.records import Proposal
from uav_task_alloc.allocator.replanning.proposal_changes import same_proposal
from uav_task_alloc.allocator.state.published_lists import shifted_list
from uav_task_alloc.allocator.state.world import World
from uav_task_alloc.errors import first_of


def _waits(proposal: Proposal) -> str:
    return f'waits for the approval of plan {proposal.revision}'


class Approvals:
    """The proposal that is open, and what was rejected last.

    Args:
        world: whose `proposal` is the open one.

    Arguments of methods:
        stamp: [s] clock of the node.
        operator: who decides; '' for the deadline.
        proposal: of a plan, without its revision.
        revision: of a proposal.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._rejected: Proposal | None = None
        self._rejected_version = -1  # of the world
        if world.proposal is not None:
            world.outbox.proposal = world.proposal

    @property
    def quiet(self) -> bool:
        """Whether no plan is sought without an event: one is open, or was just rejected."""
        return (self._world.proposal is not None
                or self._rejected_version == self._world.version)

    def propose(self, proposal: Proposal | None) -> str:
        """Open a proposal, which replaces an open one; None: no change is proposed any more.

        Returns:
            Why a task that only the proposal has in a list has no UAV yet.
        """
        world, known, rejected = self._world, self._world.proposal, self._rejected
        if proposal is None:
            if known is not None:
                self.withdraw('a newer plan needs no approval')
            return ''
        if known is not None and same_proposal(world, proposal, known):
            return _waits(known)
        if rejected is not None and same_proposal(world, proposal, rejected):
            if known is not None:
                self.withdraw('the newer plan was rejected before')
            return f'plan {rejected.revision} with it was rejected'
        replaces = f', replaces {known.revision}' if known else ''
        changes = (f'replaces plan {known.revision}',) if known else ()
        proposal = replace(proposal, revision=world.next_revision(),
                           changes=(*proposal.changes, *changes))
        self._set(proposal)
        world.note(f'plan {proposal.revision} ({proposal.trigger}) waits for approval{replaces}: '
                   f'{first_of(proposal.changes, separator="; ")}')
        return _waits(proposal)

    def refusal(self, revision: int) -> str:
        """Return why the proposal of a revision cannot be decided; '' if it can."""
        known = self._world.proposal
        if known is None:
            return 'no plan waits for approval'
        if revision != known.revision:
            return (f'revision = {revision}: expected {known.revision}, that of the plan that '
                    'waits for approval')
        return ''

    def reject(self, operator: str) -> None:
        """Drop the open proposal."""
        # the rejection itself requests a plan, so that each task has its reason
        self._rejected, self._rejected_version = self._world.proposal, self._world.version + 1
        self._close(f'rejected by {operator}' if operator else 'rejected: its time is over')

    def accept(self, operator: str) -> None:
        """Close the open proposal, whose lists are put in force."""
        self._close(f'accepted by {operator}' if operator else 'accepted: its time is over')

    def clock_jumped(self, by: float) -> None:
        """Shift the deadline and the lists of the open proposal with the published clock.

        Args:
            by: [s] of the jump.
        """
        known = self._world.proposal
        if known is not None:
            self._set(replace(
                known, stamp=known.stamp + by, deadline=known.deadline + by,
                lists=tuple(shifted_list(each, by) for each in known.lists)))

    def expired(self, stamp: float) -> bool:
        """Return whether the time of the open proposal is over."""
        proposal = self._world.proposal
        return proposal is not None and stamp >= proposal.deadline

    def withdraw(self, why: str) -> None:
        """Close the open proposal undecided.

        Args:
            why: for the log.
        """
        self._close(f'withdrawn: {why}')

    def _close(self, what: str) -> None:
        proposal = self._world.proposal
        assert proposal is not None
        text = f'plan {proposal.revision}: {what}'
        self._world.note(text)
        self._set(None)
        self._world.outbox.proposal = replace(
            proposal, lists=(), changes=(text,), deadline=0.0, accepted_on_timeout=False)

    def _set(self, proposal: Proposal | None) -> None:
        self._world.proposal = proposal
        self._world.outbox.proposal = proposal
        self._world.mark_unsaved('proposal')
