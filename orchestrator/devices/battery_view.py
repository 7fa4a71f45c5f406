"""What is known of a BMU: replaced as a whole with every change, so that another thread can take it at any time."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from orchestrator.devices.polled import Fields
from orchestrator.model import BatteryLink, BatteryReading, Cause, Measurement
from orchestrator.protocol.sdo import NmtState


class BatteryView:
    """A reading and a link that are being worked on, and the newest pair that was published."""

    __slots__ = ("_news", "_on_change", "current", "link", "reading")

    def __init__(self, problem: Cause, on_change: Callable[[], None]) -> None:
        self.reading = BatteryReading()
        self.link = BatteryLink(problem=problem)
        self.current = (self.reading, self.link)  #: what other threads may look at
        self._on_change = on_change
        self._news = False

    def measured(self, fields: Fields) -> None:
        """Take the plausible values over; a value that is not keeps the one before it, with its age, and says why.

        A value that has only been confirmed is no news: its new age is there for whoever looks next.
        """
        values: dict[str, Measurement | None] = {}
        implausible = {name: why for name, why in self.link.implausible.items() if name not in fields}
        for name, value in fields.items():
            if isinstance(value, Cause):
                implausible[name] = value
                continue
            old: Measurement | None = getattr(self.reading, name)
            if value is None or old is None or value.t_s >= old.t_s:
                values[name] = value
                self._news |= (value and value.value) != (old and old.value)
        if values:
            self.reading = replace(self.reading, **values)
        self.set(implausible=implausible)

    def doubted(self, why: Mapping[str, Cause]) -> None:
        """Values that were taken before are not to be believed any more, by field."""
        if why:
            self.set(implausible={**self.link.implausible, **why})

    def booted(self, now_s: float) -> None:
        """Nothing holds any more of what was known before."""
        old = self.link
        self.reading = BatteryReading()
        self.link = BatteryLink(
            online=old.online,
            problem=old.problem,
            boots=old.boots + 1,
            boot_t_s=now_s,
            nmt_state=int(NmtState.BOOT_UP),
            bad_frames=old.bad_frames,
            other_master=old.other_master,  # who it was that restarted the node must not be forgotten with it
            other_master_t_s=old.other_master_t_s,
            heartbeat_set=old.heartbeat_set,
            heartbeat_set_t_s=old.heartbeat_set_t_s,
        )
        self._news = True

    def dropped(self) -> None:
        """A frame was thrown away."""
        self.set(bad_frames=self.link.bad_frames + 1, news=False)

    def set(self, *, news: bool = True, **changes: object) -> None:
        """Change fields of the link; without `news` nobody is called for it."""
        changed = {name: value for name, value in changes.items() if getattr(self.link, name) != value}
        if changed:
            self.link = replace(self.link, **changed)  # type: ignore[arg-type]  # one helper for fields of all types
            self._news |= news

    def publish(self) -> None:
        """Let the others see it."""
        if self.reading is not self.current[0] or self.link is not self.current[1]:
            self.current = (self.reading, self.link)
        if self._news:
            self._news = False
            self._on_change()
