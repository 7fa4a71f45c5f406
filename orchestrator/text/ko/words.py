"""Single words used as parameters, how advice and evidence are combined, and how lists are joined."""

from collections.abc import Mapping

WORDS: Mapping[str, str] = {
    # bits of the BMU's status
    "over_voltage": "과전압",
    "low_voltage": "저전압",
    "charge_over_current": "충전 과전류",
    "discharge_over_current": "방전 과전류",
    "high_temperature": "고온",
    "low_temperature": "저온",
    "bmu_error": "BMU 에러",
    # NMT states
    "boot_up": "boot-up",
    "stopped": "stopped",
    "pre_operational": "pre-operational",
    # the values a charge needs
    "voltage": "전압",
    "current": "전류",
    "status": "상태",
    "temperature": "온도",
    "soc": "SOC",
    "soh": "SOH",
    "pack_voltage": "팩 전압",
    "long": "오래",
    # the values of a battery by their names
    "voltage_v": "팩 전압",
    "current_a": "팩 전류",
    "temperature_c": "온도",
    "soc_pct": "SOC",
    "soh_pct": "SOH",
    "time_to_full_min": "완충 예상 시간",
    "time_to_empty_min": "방전 예상 시간",
    "remaining_ah": "잔여 용량",
    "available_wh": "가용 에너지",
    # how a battery's id is known
    "assumed": "추정",
    "typed": "작업자 입력",
    "serial_number": "일련번호",
    # times within an hour
    "nth_1": "1",
    "nth_2": "2",
    "nth_3": "3",
    # the charger's modes, commands and error bits
    "manual": "수동",
    "automatic": "자동",
    "run": "기동",
    "resume": "재개",
    "stop": "정지",
    "start": "시작",
    "reset": "리셋",
    "limit": "전류 제한",
    "step": "단계",
    "mode": "충전 모드",
    "precharge": "프리차지",
    "length": "Length",
    "command": "Command",
    "order": "Order",
    "checksum": "Checksum",
}
FRAMES: Mapping[str, str] = {
    "advice": "{what}. {do}",
    "trip": "{do} – {what}",
    "strikes": "{do}. 1시간 안에 {strikes}회 발생했으므로 사람이 리셋해야 합니다",
    "unknown": "{id} ({params})",
    "where": "{where}: {what}",
    "place": "({place})",
    "because": "{what}: {because}",
    "list": ", ",
    "and": ", ",
    "then": ". ",
    # present and past times, and the figures then and now
    "at": "{raised_at}: {what}",
    "since": "{since_at}부터",
    "was": "{since_at}에는 {was:and}",
    "now": "지금은 {now:and}",
}
