"""The present knowledge about one charger: its newest reading, and the state of its link."""

from collections.abc import Callable
from dataclasses import replace

from orchestrator.devices.dialogue import SILENCE, Dialogue, Heard
from orchestrator.devices.line_quality import LineQuality
from orchestrator.model import Cause, ChargerLink, ChargerReading

#: This many consecutive polls without an answer are silence: with one frame in a hundred lost, three misses in a row
#: occur every seven hours, five once in two years. Five take 1.12 s of the 2.0 s allowed for noticing silence.
MISSES_UNTIL_SILENT = 5
#: Late answers are no accident: the requests repeat after three, and a late answer could then pass for a fresh one.
LATE_UNTIL_SILENT = 3


class ChargerView:
    """The newest consistent pair; `on_change()` is called after each reading and each change of the link."""

    __slots__ = ("_on_change", "_port", "_quality", "current")

    def __init__(self, port: str, on_change: Callable[[], None]) -> None:
        self._port, self._on_change = port, on_change
        self._quality = LineQuality()
        #: For other threads.
        self.current: tuple[ChargerReading | None, ChargerLink] = (
            None,
            ChargerLink(problem=Cause.of("port_not_opened", port=port)),
        )

    @property
    def link(self) -> ChargerLink:
        """The state of the link."""
        return self.current[1]

    def polled(self, reading: ChargerReading | None, dialogue: Dialogue, now_s: float, refused: Cause | None) -> None:
        """A poll is over; `reading` is None without an answer, `refused` says why a command was not sent instead."""
        link = self.link
        misses = 0 if reading else link.misses + 1
        problem = None if reading else link.problem
        silent = misses >= (LATE_UNTIL_SILENT if dialogue.heard is Heard.LATE_REPLY else MISSES_UNTIL_SILENT)
        complained = dialogue.error_t_s != link.error_t_s
        self._quality.count(now_s, bad=reading is None or complained)
        if silent:
            problem = Cause.of(SILENCE[dialogue.heard], port=self._port)
        self.publish(
            reading,
            online=reading is not None or (link.online and not silent),
            misses=misses,
            problem=problem,
            refused=refused,
            error_bits=dialogue.error_bits,
            error_t_s=dialogue.error_t_s,
            bad_frames=dialogue.bad_frames,
            bad_pct=self._quality.bad_pct,
        )

    def publish(self, reading: ChargerReading | None = None, **changes: object) -> None:
        """Publish changes to other threads."""
        last_reading, last_link = self.current
        link = replace(last_link, **changes)  # type: ignore[arg-type]  # the callers name the fields of ChargerLink
        if reading is None and link == last_link:
            return
        self.current = (reading or last_reading, link)
        self._on_change()
