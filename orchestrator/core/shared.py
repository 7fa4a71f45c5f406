"""A port that another service has: what that service does with the charger, and why, is not known here.

A person may have stopped the charger there. So once the port is free, the bay waits for a person.
"""

from orchestrator.model import Cause, ChargerLink

#: The problem of a port that another service holds.
OF_SERVICE = "port_of_service"
UNKNOWN = "program_unknown"


def shared(link: ChargerLink) -> Cause | None:
    """Why the bay must wait for a person, if another service, or nobody knows who, holds its port now."""
    if link.problem is not None and link.problem.id == OF_SERVICE:
        return Cause.of("port_was_shared", **dict(link.problem.params))
    if link.locked_by is not None and link.locked_by.id == UNKNOWN:
        return Cause("port_was_locked")
    return None
