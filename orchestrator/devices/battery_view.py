"""The present knowledge about a BMU: replaced as a whole on every change, so any thread can read it at any time."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from orchestrator.devices.polled import Fields
from orchestrator.model import BatteryLink, BatteryReading, Cause, Measurement
from orchestrator.protocol.sdo import NmtState


class BatteryView:
    """A reading and a link under construction, and the newest published pair."""

    __slots__ = ("_built", "_changed", "_news", "_on_change", "_published", "_values", "link")

    def __init__(self, problem: Cause, on_change: Callable[[], None]) -> None:
        self.link = BatteryLink(problem=problem)
        self._values: dict[str, Measurement | None] = {}
        self._on_change = on_change
        self._news = self._changed = False
        self._published: tuple[dict[str, Measurement | None], BatteryLink] = {}, self.link
        self._built = self._published, (BatteryReading(), self.link)

    @property
    def current(self) -> tuple[BatteryReading, BatteryLink]:
        """The pair for other threads. The reading is built only when somebody asks for it."""
        published, built = self._published, self._built
        if built[0] is not published:
            self._built = built = published, (BatteryReading(**published[0]), published[1])
        return built[1]

    @property
    def amps(self) -> Measurement | None:
        """The newest current into the pack."""
        return self._values.get("current_a")

    def measured(self, fields: Fields) -> None:
        """Store plausible values; an implausible one leaves the previous value with its age, and is explained.

        A confirmed value is not news: its new age is there for the next reader.
        """
        implausible: dict[str, Cause] = {}
        for name, value in fields.items():
            if isinstance(value, Cause):
                implausible[name] = value
                continue
            old = self._values.get(name)
            if value is None or old is None or value.t_s >= old.t_s:
                self._values[name] = value
                self._changed = True
                self._news |= (value and value.value) != (old and old.value)
        if implausible or self.link.implausible:
            others = {name: why for name, why in self.link.implausible.items() if name not in fields}
            self.set(implausible={**others, **implausible})

    def doubted(self, why: Mapping[str, Cause]) -> None:
        """Mark values stored earlier as implausible, by field."""
        if why:
            self.set(implausible={**self.link.implausible, **why})

    def booted(self, now_s: float) -> None:
        """Forget everything known before the boot."""
        old = self.link
        self._values = {}
        self.link = BatteryLink(
            online=old.online,
            problem=old.problem,
            boots=old.boots + 1,
            boot_t_s=now_s,
            nmt_state=int(NmtState.BOOT_UP),
            bad_frames=old.bad_frames,
            other_master=old.other_master,  # it may have restarted the node, so keep it
            other_master_t_s=old.other_master_t_s,
            heartbeat_set=old.heartbeat_set,
            heartbeat_set_t_s=old.heartbeat_set_t_s,
        )
        self._news = self._changed = True

    def dropped(self) -> None:
        """Count a discarded frame."""
        self.set(bad_frames=self.link.bad_frames + 1, news=False)

    def set(self, *, news: bool = True, **changes: object) -> None:
        """Change fields of the link; without `news`, nobody is notified."""
        changed = {name: value for name, value in changes.items() if getattr(self.link, name) != value}
        if changed:
            self.link = replace(self.link, **changed)  # type: ignore[arg-type]  # one helper for fields of all types
            self._changed = True
            self._news |= news

    def publish(self) -> None:
        """Publish the pair to other threads."""
        if self._changed:
            self._changed = False
            self._published = dict(self._values), self.link
        if self._news:
            self._news = False
            self._on_change()
