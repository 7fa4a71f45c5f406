"""Korean particles follow the last sound, and no sentence shows both forms where one is right."""

import pytest

from orchestrator.model import Cause
from orchestrator.text.catalogue import say
from orchestrator.text.ko.particles import resolved


@pytest.mark.parametrize(
    ("open_", "chosen"),
    [
        ("과전압을(를)", "과전압을"), ("BMU 에러을(를)", "BMU 에러를"), ("140은(는)", "140은"), ("255은(는)", "255는"),
        ("-3.5은(는)", "-3.5는"), ("20 %이(가)", "20 %가"), ("35.0 °C을(를)", "35.0 °C를"), ("10초(으)로", "10초로"),
        ("0x1F이(가)", "0x1F가"), ("0x13이(가)", "0x13이"), ("7(으)로", "7로"), ("6(으)로", "6으로"),
        ("저널(으)로", "저널로"),
        ("BMU을(를)", "BMU를"), ("URL이(가)", "URL이"),
        ("a.sock을(를)", "a.sock을"), ("bay-1은(는)", "bay-1은"), ("bay-2은(는)", "bay-2는"),
        ("/dev/ttyUSB0을(를)", "/dev/ttyUSB0을"), ("run/state.json을(를)", "run/state.json을"),
        ("file이(가)", "file이"),
        ("정책 li-ion-48v(x.yaml, sha256 ab)이(가)", "정책 li-ion-48v(x.yaml, sha256 ab)가"),
        ("over_temperature을(를)", "over_temperature를"), ("reset을(를)", "reset을(를)"), ("(을(를)", "(을(를)"),
        ("한 줄(하나)을(를)", "한 줄(하나)을"), ("38400 baud(으)로", "38400 baud로"),
    ],
)  # fmt: skip
def test_it_follows_the_last_sound(open_: str, chosen: str) -> None:
    assert resolved(open_) == chosen


def test_what_is_said_has_its_particles() -> None:
    trip = Cause.of("status_trip", bits=("over_voltage", "bmu_error"), status=65)
    assert say(trip, "ko") == "BMU가 과전압, BMU 에러를 보고합니다(상태 워드 0x0041)"
    high = Cause.of("value_outside", field="soc_pct", value=255.0, low=0.0, high=100.0, raw="0xFF")
    assert say(high, "ko") == "SOC 255는 0 … 100 범위를 벗어납니다(원시 값 0xFF)"
    assert say(high) == "SOC 255 is outside 0 … 100 (raw 0xFF)"
    assert say(high.with_(past=True)) == "SOC 255 was outside 0 … 100 (raw 0xFF)"


def test_times_and_places_are_written_as_koreans_do() -> None:
    rises = Cause.of("rises", place="policies/li-ion-48v.yaml:43", hold_s=10.0)
    assert say(rises, "ko") == "더 높은 단계가 허용되어 10초 후에 적용됩니다(policies/li-ion-48v.yaml:43)"
    again = Cause.of("goes_on_in", gone=Cause.of("gone", gone_at="09:41:22"), left_s=8, strike=None)
    assert say(again, "ko") == "09:41:22에 해소됨, 8초 후에 자동으로 재개합니다"
