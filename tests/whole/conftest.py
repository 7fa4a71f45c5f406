"""`station`: a plant and a service that charges already, or what the test's mark `station` says of them."""

from collections.abc import Iterator

import pytest

from tests.whole.ahead import Ahead, Recipe, Station, stations_ahead


def recipe_of(item: pytest.Item) -> Recipe:
    mark = item.get_closest_marker("station")
    return Recipe(*mark.args, **mark.kwargs) if mark else Recipe()


@pytest.fixture(name="ahead", scope="module")
def _ahead(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ahead]:
    items = [one for one in request.session.items if one.path == request.path and "ahead" in one.fixturenames]  # type: ignore[attr-defined]
    with stations_ahead(
        {one.nodeid: recipe_of(one) for one in items}, lambda: tmp_path_factory.mktemp("station")
    ) as ahead:
        yield ahead


@pytest.fixture(name="station")
def _station(ahead: Ahead, request: pytest.FixtureRequest) -> Iterator[Station]:
    with ahead.take(request.node.nodeid) as station:
        yield station
