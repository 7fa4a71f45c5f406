"""What limits the current, with its evidence and the line that sets it."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    "limit_none": "가장 높은 단계이며 제한이 없습니다",
    "limit_fault": "{fault} 장애",
    "limit_pack": "팩의 허용 전류는 {allowed_a:.1f} A입니다({place})",
    "limit_station": "스테이션의 전류 한계({place})",
    "limit_unknown": "{quantity:word} 값을 알 수 없습니다({place})",
    "limit_outside": "{value}: 정책의 표에 없는 값입니다({place})",
    "limit_row": "{spans:and}: {allows}({place})",
    # a quantity with its value, and the row it is in
    "value_temperature_c": "온도 {pack_c:.1f} °C",
    "value_soc_pct": "SOC {soc_pct:.0f} %",
    "value_soh_pct": "SOH {soh_pct:.0f} %",
    "value_voltage_v": "팩 전압 {pack_v:.2f} V",
    "span_unknown": "{quantity:word} 값을 알 수 없음",
    "span_in": "{value}({low:g} … {high:g} 구간)",
    "span_near": "{value}({low:g} … {high:g} 구간을 아직 {well:g} 이상 벗어나지 않음)",
    "span_left": "{value}({low:g} … {high:g} 구간을 벗어남)",
    "span_kept": "{value}({low:g} … {high:g} 구간 밖이나 이번 충전에서 너무 자주 되돌아옴)",
    # what the row allows
    "allows_nothing": "전류를 허용하지 않습니다",
    "allows_a": "{allowed_a:.1f} A까지 허용합니다",
    "allows_c": "{allowed_a:.1f} A({max_c:g} C)까지 허용합니다",
    # what else bounds a charge
    "limit_volts": "{most_v:g} V보다 높으면 전류를 흘리지 않습니다({place})",
    "limit_temperature": "{low:g} … {high:g} °C 밖에서는 전류를 흘리지 않습니다({place})",
    "limit_ah": "한 번의 충전이 {most:.3g} Ah를 넘으면 장애입니다({place})",
    "limit_h": "한 번의 충전이 {most:.3g}시간을 넘으면 장애입니다({place})",
    # what a supply leaves
    "supply_promises": "전원 {supply}: {limit_w:,.0f} W 중 {used_w:,.0f} W 배정",
    "supply_waiting": "기다리는 베이: {bays}",
    "supply_full": "전원 {supply}: {limit_w:,.0f} W 중 {used_w:,.0f} W가 배정되었습니다{at}",
    "supply_turn": "전원 {supply}: {limit_w:,.0f} W 중 {used_w:,.0f} W가 배정되었습니다{at}. {other}의 차례가 끝나기를 기다리며 {turn_at}에 차례가 됩니다",
    "supply_line": "전원 {supply}: {limit_w:,.0f} W 중 {used_w:,.0f} W가 배정되었습니다{at}. 순서를 기다립니다",
    "supply_never": "전원 {supply}의 한도 {limit_w:,.0f} W{at}로는 가장 낮은 단계도 쓸 수 없습니다. {need_w:,.0f} W가 필요합니다",
    "supply_unproved": "전원 {supply}: 아직 {limit_w:,.0f} W 중 {used_w:,.0f} W로 계산됩니다{at}. 출력 감소가 확인되기를 기다립니다: {others:and}",
    "supply_asks": "지금까지 전원 {supply}에 더 요청된 것이 없습니다",
    "supply_raise": "전원 {supply}에 여유가 있어 {raise_at}에 첫 단계를 시작합니다",
    "supply_rises": "전원 {supply}에 여유가 있어 1분 안에 단계를 올립니다",
    "supply_not_in_hand": "충전기를 제어할 수 없어, 대기 상태가 확인될 때까지 전원 {supply}에서 {counts_w:,.0f} W로 계산합니다",
    "supply_unknown_bays": "충전기를 제어할 수 없어 가장 높은 단계로 계산하는 베이: {bays}",
}
