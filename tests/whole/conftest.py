"""`station`: a plant and a service that charges already, or what the test's mark `station` says of them."""

from collections.abc import Iterator

import pytest

from tests.whole.recipe import Recipe, Station, made


@pytest.fixture(name="station")
def _station(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    mark = request.node.get_closest_marker("station")
    recipe = Recipe(*mark.args, **mark.kwargs) if mark else Recipe()
    with made(recipe, tmp_path_factory.mktemp("station")) as station:
        yield station
