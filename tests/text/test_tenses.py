"""What a device's line says of it may be the evidence of a fault that is gone: it needs both tenses."""

import pytest

from orchestrator.text.catalogue import LANGUAGES
from orchestrator.text.en.links import TEXTS

#: Verbless, or never the evidence of a fault.
WITHOUT = {"bmu_not_asked", "charger_no_reply", "bmu_internal", "charger_internal"}
EVIDENCE = [id_ for id_ in TEXTS if id_.startswith(("bmu_", "charger_")) and id_ not in WITHOUT]


@pytest.mark.parametrize("id_", EVIDENCE)
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_device_that_answers_badly_is_told_of_in_both_tenses(language: str, id_: str) -> None:
    assert LANGUAGES[language].texts[id_] != LANGUAGES[language].past[id_]
