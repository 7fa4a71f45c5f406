"""Everything this package raises on purpose.

One tree, so that a caller can catch by what must happen next: a configuration is mended by a person, a link comes back
by itself, a refusal is answered.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orchestrator.model import Cause


class OrchestratorError(Exception):
    """Root of every error that is raised on purpose; its text is written for the person who must act."""


@dataclass(frozen=True, slots=True, order=True)
class Finding:
    """One thing wrong in a file that a person wrote: where it is, what it is and what is allowed there."""

    file: str
    line: int
    column: int
    text: str
    severity: str = "error"  #: or "warning": it can be used as it is, and can hardly be meant

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}: {self.severity}: {self.text}"


class ConfigError(OrchestratorError):
    """A station, policy or object-map file cannot be used; `findings` has every reason, not only the first."""

    def __init__(self, findings: tuple[Finding, ...]) -> None:
        super().__init__("\n".join(map(str, findings)))
        self.findings = findings


class CauseError(OrchestratorError):
    """One that is told as data: its sentence is made at the edge, in the language of who reads it."""

    def __init__(self, cause: "Cause") -> None:
        super().__init__(f"{cause.id} ({', '.join(f'{name}={value}' for name, value in cause.params)})")
        self.cause = cause


class LinkError(CauseError):
    """A port or a bus cannot be used now: unplugged, stalled, busy, down. It may come back."""


class ProtocolError(OrchestratorError):
    """An answer came whole and with a good checksum, but it is not what was asked for: expected and got."""


class UsageError(OrchestratorError):
    """The command line cannot be understood; the text says what is missing."""


class HexError(OrchestratorError):
    """Text that a person gave is not hexadecimal: which characters, and where."""


class RefusedError(OrchestratorError):
    """The interlock or the state machine did not let something through; the text names the reason."""


class ServiceError(OrchestratorError):
    """The service cannot be reached or answered with an error; `told` is that as data, where the service said so."""

    def __init__(self, text: str, told: object = None) -> None:
        super().__init__(text)
        self.told = told


class NoServiceError(ServiceError):
    """The service cannot be reached: whatever is to be done must be done without it."""


class RequestError(CauseError):
    """A request to the running service is not understood, or cannot be done."""


class StartError(CauseError):
    """The service cannot run here: what it needs is another's, or too little."""
