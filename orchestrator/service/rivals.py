"""Whether another service has one of this station's ports: then this one must not begin.

Only a service's controller counts: `estop`, or a guardian's last stop, releases a port after some seconds.
"""

from collections.abc import Iterable

from orchestrator.errors import StartError
from orchestrator.lastresort.port_owner import controller_on
from orchestrator.link.port_cause import of_service


def refuse_shared(ports: Iterable[str]) -> None:
    """StartError where another service has one of them; no port is touched."""
    for port in ports:
        if pid := controller_on(port):
            raise StartError(of_service(port, pid))
