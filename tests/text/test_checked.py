"""The last line of `check`."""

import pytest

from orchestrator.text.checked import THINGS, THINGS_KO, summary


@pytest.mark.parametrize(
    ("looked_at", "errors", "warnings", "english", "korean"),
    [
        (
            {"bay": 2, "policy": 2}, 0, 1,
            "2 bays, 2 policies: no errors, 1 warning", "베이 2개, 정책 2개: 오류 없음, 경고 1건",
        ),
        (
            {"bay": 1, "policy": 1}, 0, 0,
            "1 bay, 1 policy: no errors, no warnings", "베이 1개, 정책 1개: 오류 없음, 경고 없음",
        ),
        ({"scenario": 1, "map": 2}, 1, 0, "2 object maps, 1 scenario: 1 error", "객체 맵 2개, 시나리오 1개: 오류 1건"),
        ({"file": 1, "bay": 0}, 3, 2, "1 file: 3 errors, 2 warnings", "파일 1개: 오류 3건, 경고 2건"),
    ],
)  # fmt: skip
def test_it_counts_in_both_languages(
    looked_at: dict[str, int], errors: int, warnings: int, english: str, korean: str
) -> None:
    assert summary(looked_at, errors, warnings) == english
    assert summary(looked_at, errors, warnings, "ko") == korean
    assert summary(looked_at, errors, warnings, "") == english


def test_whatever_is_counted_has_a_name_in_both() -> None:
    assert THINGS.keys() == THINGS_KO.keys()
