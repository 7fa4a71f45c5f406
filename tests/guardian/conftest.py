"""A service is queried until `estop` ends. Inside a test nothing ends: the queries would go on beside other tests."""

from collections.abc import Iterator

import pytest

from orchestrator.lastresort.running_service import Service


@pytest.fixture(autouse=True)
def no_query_goes_on(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    started: list[Service] = []
    start = Service.start

    def noted(service: Service) -> None:
        started.append(service)
        start(service)

    monkeypatch.setattr(Service, "start", noted)
    yield
    monkeypatch.setattr(Service, "_hold", lambda _: False)  # no service any more
    for service in started:
        service.told.clear()
        service._thread.join(5.0)
        assert not service._thread.is_alive(), "a query of a service does not end"
