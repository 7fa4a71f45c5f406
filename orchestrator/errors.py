"""Every exception that this package raises on purpose.

They form one tree, so that callers can catch them by what must happen next: a person fixes a configuration, a link
recovers by itself, a refusal is reported.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orchestrator.model import Cause


class OrchestratorError(Exception):
    """Root of every error raised on purpose; its text addresses the person who must act."""


@dataclass(frozen=True, slots=True, order=True)
class Finding:
    """One mistake in a file that a person wrote: where it is, what it is and what is allowed there."""

    file: str
    line: int
    column: int
    text: str
    severity: str = "error"  #: or "warning": valid, but probably unintended

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}: {self.severity}: {self.text}"


class ConfigError(OrchestratorError):
    """A station, policy, object-map or scenario file is unusable; `findings` has every reason, not only the first."""

    def __init__(self, findings: tuple[Finding, ...]) -> None:
        super().__init__("\n".join(map(str, findings)))
        self.findings = findings


class CauseError(OrchestratorError):
    """One that is told as data: its sentence is made at the edge, in the language of who reads it."""

    def __init__(self, cause: "Cause") -> None:
        super().__init__(f"{cause.id} ({', '.join(f'{name}={value}' for name, value in cause.params)})")
        self.cause = cause


class LinkError(CauseError):
    """A port or a bus cannot be used now: unplugged, stalled, busy, down. It may recover."""


class ProtocolError(OrchestratorError):
    """A reply arrived complete and with a good checksum, but does not match the request; says expected and got."""


class UsageError(OrchestratorError):
    """The command line is invalid; the text says what is missing."""


class NoSocketError(CauseError, UsageError):
    """Nothing names the service that a verb is for."""


class HexError(OrchestratorError):
    """A person's input is not hexadecimal; the text names the characters and their positions."""


class RefusedError(OrchestratorError):
    """The interlock or the state machine refused something; the text names the reason."""


class ServiceError(OrchestratorError):
    """The service cannot be reached or answered with an error; `told` is that as data, where the service said so."""

    def __init__(self, text: str, told: object = None) -> None:
        super().__init__(text)
        self.told = told


class NoServiceError(ServiceError):
    """The service cannot be reached: the caller must do without it."""


class RequestError(CauseError):
    """A request to the running service is not understood, or cannot be done."""


class StartError(CauseError):
    """The service cannot run here: what it needs is another's, or too little."""
