"""A battery's health, as its charges show it."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    "health": "상태:",
    "health_none": "배터리 {battery}: 종료된 충전 기록이 없습니다",
    "health_method": "건강 상태: 평가 방식 {method}; 충전 {charges}회, 마지막 충전 종료 {end_at}",
    "health_mixed": "이 ID로 다른 배터리가 충전되었을 수 있습니다: 배터리마다 orchestrator identify로 ID를 지정하십시오",
    "health_capacity": "용량: {ah:.2f} Ah(95 % 구간 {low:.2f} … {high:.2f} Ah), 충전 {charges}회 기준",
    "health_capacity_none": "용량: 아직 알 수 없습니다: {lowest_c:g} … {highest_c:g} °C에서 SOC가 급변 없이 {rise_pct:g} % 이상 "
    "오른 충전이 1년 안에 {least}회 필요하며, 현재 {charges}회입니다",
    "health_soh": "건강 상태(SOH): 정격 {rated_ah:g} Ah의 {pct:.0f} %(95 % 구간 {low:.0f} … {high:.0f} %)",
    "health_bmu": "BMU 기준 SOH: {pct:.0f} %",
    "health_parts": "BMU의 SOH {bmu_pct:.0f} %는 충전 기록이 보여 주는 {low:.0f} … {high:.0f} %와 맞지 않습니다. SOH에 따른 "
    "제한은 BMU 값을 따릅니다: 용량을 측정하고, BMU가 틀렸으면 교정하십시오",
    "health_resistance": "저항: 25 °C에서 {mohm:.1f} mΩ(95 % 구간 {low:.1f} … {high:.1f} mΩ), {lowest_c:.0f} … {highest_c:.0f} "
    "°C에서 충전 {charges}회의 전류 변화 {changes}건 기준",
    "health_resistance_none": "저항: 아직 알 수 없습니다: SOC {low_pct:g} … {high_pct:g} %, {lowest_c:g} … {highest_c:g} °C에서 "
    "전류가 한 번에 {least_a:g} A 이상 바뀐 충전이 1년 안에 {least}회 필요하며, 현재 {charges}회입니다",
    "health_balance": "전하량 비교: 충전기가 공급한 양의 {pct:.1f} %를 BMU가 집계했습니다",
    "health_rest": "무부하 전압: SOC {soc_pct:.0f} %에서 {pack_v:.2f} V({begin_at} 충전 직전)",
    "health_stress": "충전 중 누적: 종료 전압의 {share_pct:.0f} % 이상 {high}, {hot_c:g} °C 이상 {hot}",
    "health_deep": "과방전: 충전 {charges}회 중 {deep}회가 프리차지로 시작했습니다",
    "health_faults": "충전 중 발생한 장애: {faults}",
    "health_no_faults": "충전 중 발생한 장애: 없음",
}
