"""Contacts between bodies as events: who touched whom, when, and how hard."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContactEvent:
    """Two bodies touched."""

    first: str  # name of an actor, element or prop
    second: str
    start: int  # physics step since frame 0; negative during the warm-up
    end: int  # the last step with contact
    impulse: float  # N s, all together
