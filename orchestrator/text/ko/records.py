"""What is said of the charges on record, in Korean."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    # why a charge ended, where the record found it open
    "service_died": "서비스가 비정상 종료되었습니다; 마지막 동작 확인: {last_at}",
    "end_unseen": "이 충전의 종료가 확인되지 않았습니다",
    # the charges on record
    "charge_open": "종료되지 않음",
    "charges_none": "충전 기록이 없습니다",
    "charges_more": "{charges}건 중 최근 {shown}건; 모두 보려면 --limit 0",
    "charges_unreadable": "{folder}을(를) 읽을 수 없습니다: {error}",
    "charge_unknown": "ID가 {id}(으)로 끝나는 충전 기록이 없습니다",
    "charge_of": "충전 {id}: {bay}, {station}",
    "battery_assumed": "배터리 {battery}, 노드 ID로 추정",
    "battery_typed": "배터리 {battery}, 작업자가 입력",
    "battery_serial_number": "배터리 {battery}, 배터리의 일련번호",
    "charge_time": "{begin_at} ~ {end_at}, {lasted}",
    "charge_ended": "종료: {why}",
    "charge_took": "충전기 기준 {ah:.2f} Ah, {wh:.1f} Wh; BMU 기준 {bmu_ah:.2f} Ah, {bmu_wh:.1f} Wh",
    "charge_policy": "정책 {policy}, sha256 {sha256}; 버전 {software}",
    "charge_by": "{by}",
    "charge_stop": "정지 확인까지 {took_ms:.0f} ms",
    "charge_rules": "전류를 제한한 규칙:",
    "charge_rule": "{lasted}, {ah:.2f} Ah: {rule} ({at_line})",
    "charge_no_rule": "{lasted}, {ah:.2f} Ah: 충전기 외에 없음",
    "charge_pauses": "일시 정지:",
    "charge_faults": "고장:",
    # a month
    "report_title": "{month} 충전",
    "report_of": "{month}에 시작된 충전(현지 시각: {zones:word}), {stations:word}",
    "report_head": "베이|충전|완충|AH|KWH|평균 완충 시간",
    "report_total": "합계",
    "report_ends": "종료 원인:",
    "report_ends_head": "충전|원인|최근 베이|시작|종료 이유",
    "report_look": "점검이 필요한 배터리:",
    "report_none": "{month}에 시작된 충전 기록이 없습니다",
    "look_faults": "고장으로 충전이 모두 {times}회 중단되었습니다: {faults:word}",
    "look_soh": "BMU가 보고한 SOH가 {soh_pct:.0f} %로 {least_pct:.0f} % 미만입니다",
    "look_amounts": "충전기 기준 {ah:.1f} Ah, BMU 기준 {bmu_ah:.1f} Ah입니다. 어느 쪽의 측정이 틀렸는지 확인하십시오",
    "page_not_written": "{file}을(를) 쓸 수 없습니다: {error}",
    # the index
    "index_damaged": "기록의 색인이 손상되어({error}) {file}(으)로 옮겨 두고 새로 만들었습니다",
    "index_not_written": "{folder}에 색인을 쓸 수 없어({error}) 모든 기록을 직접 읽었습니다. 기록이 많을수록 오래 걸립니다",
    "index_busy": "다른 명령이 색인을 만들고 있습니다. 끝난 뒤에 다시 시도하십시오",
    "index_rebuilt": "색인을 새로 만들었습니다: 충전 {charges}건",
}
