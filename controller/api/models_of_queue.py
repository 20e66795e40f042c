"""What is sent and answered about the queue."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from controller.api.answers import Texts
from controller.api.models import Number, Sent, Told

Count = Annotated[int, Field(ge=1, le=10_000)]


class NewEntry(Sent):
    program: Annotated[str, Field(min_length=1, max_length=200, description="Name in the store.")]
    count: Count = 1


class EntryChange(Sent):
    """What is null stays."""

    count: Count | None = None
    place: Annotated[int | None, Field(ge=0, le=10_000, description="0: the first.")] = None


class EntryFacts(Told):
    id: int
    program: str
    count: int
    done: int = Field(description="Of these so many ran to their end.")
    added_s: Number
    added_by: str


class QueueFacts(Told, Texts):
    """What is said is why it does not go on by itself any more."""

    entries: list[EntryFacts]
    next: int | None = Field(description="The entry that is next: the first that is not done.")
    go_on: bool = Field(description="What is next is loaded and started when a run has ended whole.")
