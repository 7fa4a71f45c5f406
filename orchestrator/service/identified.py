"""The identity of the battery in one bay, from decision to decision: the only place that says which battery it is.

What an operator has typed is kept over restarts, and dropped when the battery leaves, or what is there may be another
one. No change is silent: each is in the journal and in the log.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from orchestrator.config.station import BayConfig
from orchestrator.core.memory import Memory
from orchestrator.core.persisted import Persisted
from orchestrator.model import Cause, Snapshot
from orchestrator.model.cause import plain
from orchestrator.model.document import IdentityFields
from orchestrator.model.identity import Identity
from orchestrator.service.journal import Journal
from orchestrator.service.past import Place
from orchestrator.service.store import Store
from orchestrator.text.catalogue import say as sentence


@dataclass(slots=True)
class Named:
    """An id that an operator has typed, on its way into the persisted state."""

    battery: str
    refusal: Cause | None = None
    revision: int = 0  #: the revision that persists it; valid once `identity` is there
    identity: Identity | None = None


class Identified:
    """Used by the control loop, except `name` and `status`."""

    def __init__(
        self, bay: BayConfig, store: Store, journal: Journal, say: Callable[[Cause], None], language: str
    ) -> None:
        self._bay, self._place = bay, Place.of(bay)
        self._store, self._journal, self._say, self._language = store, journal, say, language
        self._serial: int | None = None
        self._typed: str | None = None  # None before the first decision: the persisted state is still being read
        self.identity = Identity.of(bay.battery.can, bay.battery.node_id, None, "")  #: the present one
        self._status = (self.identity, self._fields(self.identity))
        self.asked: deque[Named] = deque()  #: what operators have typed that no decision has taken yet
        self._taken: list[Named] = []  # what one has taken, without its revision yet

    def name(self, battery: str) -> Named:
        """Submit what an operator has typed; the next decision takes it. Any thread."""
        named = Named(battery)
        self.asked.append(named)
        return named

    def status(self) -> IdentityFields:
        """The battery's part of the status document. Any thread."""
        now, (known, status) = self.identity, self._status
        if now != known:
            status = self._fields(now)
            self._status = (now, status)
        return status

    def follow(self, now_s: float, snapshot: Snapshot, memory: Memory) -> None:
        """Follow a decision: made from `snapshot`, with `memory` as its result."""
        begins = self._typed is None
        if self._typed is None:
            self._typed, self._serial = self._store.past(self._place).typed, memory.battery.serial
        link, another = snapshot.battery_link, memory.battery.another
        self._look(link.serial if link.online else None, another=another)
        battery = self._bay.battery
        identity = Identity.of(battery.can, battery.node_id, self._serial, self._typed)
        if identity != self.identity or begins:
            self._tell(identity, now_s, aloud=identity != self.identity)
        self.identity = identity

    def _look(self, serial: int | None, *, another: bool) -> None:
        """Until the BMU has told its serial number again, the last one holds, unless this may be another battery."""
        if another:
            self._typed, self._serial = "", None
        if serial is not None:
            self._serial = serial or None
        while self.asked:
            named = self.asked.popleft()
            if another:
                named.refusal = Cause.of("identify_nobody", bay=self._bay.name)
            else:
                self._typed = named.battery
                self._taken.append(named)

    def kept(self, persisted: Persisted) -> Persisted:
        """This state, and what an operator has typed."""
        return replace(persisted, typed=self._typed or "")

    def answer(self, revision: int) -> None:
        """What was taken is on disk with this revision."""
        for named in self._taken:
            named.revision = revision
            named.identity = self.identity  # last: it says that the revision is there
        self._taken.clear()

    def _tell(self, identity: Identity, now_s: float, *, aloud: bool) -> None:
        self._journal.put(self._bay.name, ("battery", self._fields(identity)), now_s)
        if aloud:
            self._say(Cause.of("identity_now", bay=self._bay.name, what=identity.cause))

    def _fields(self, identity: Identity) -> IdentityFields:
        return {
            "id": identity.id,
            "source": identity.source.value,
            "typed": identity.typed,
            "contradicted": identity.contradicted,
            "cause": plain(identity.cause),
            "text": sentence(identity.cause, self._language),
        }
