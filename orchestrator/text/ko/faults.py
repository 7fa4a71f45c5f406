"""The evidence of each fault, with value, limit and place."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    # what the charger reports
    "reverse_polarity": "충전기가 연결 상태 0을 {보고합니다|보고했습니다}: 배터리가 역결선되어 {있습니다|있었습니다}",
    "reverse_polarity_mode": "충전기가 모드 6을 {보고합니다|보고했습니다}: 배터리가 역결선되어 {있습니다|있었습니다}",
    "polarity_contradicts": "충전기의 보고가 서로 {모순됩니다|모순되었습니다}: 모드 6(배터리 역결선)과 연결 상태 1(정상)",
    "error_stop": "충전기가 모드 8(에러 정지)을 {보고합니다|보고했습니다}: 충전기 자체 에러로 정지했습니다",
    "system_stop": "충전기가 모드 7(시스템 정지)을 {보고합니다|보고했습니다}: 명령 없이 스스로 정지했습니다",
    "illegal_value": "충전기가 규격에 없는 값을 {보고합니다|보고했습니다}: {values:word}",
    "mode_taken_over": "충전기는 {shown:word} {모드이고|모드였고} 스테이션 파일에는 {configured:word} 모드로 되어 있습니다",
    "rejected_frame": "충전기가 에러 프레임(0x1F)으로 응답했습니다: 수신한 내용의 {wrong:and} 오류",
    "line_taken_over": "다른 프로그램이 {port}의 설정을 {settings}(으)로 바꾸었습니다. 다시 설정했습니다",
    "port_locked": "다른 프로그램이 {port}을(를) 점유하고 {있습니다|있었습니다}: {program}. 그래도 충전기 정지는 {수행합니다|수행했습니다}",
    "noisy_line": "{지난 1분간|1분 동안} 충전기와의 통신 중 {bad_pct:.0f} %가 실패했습니다(기준 {limit_pct:g} %)",
    # whether it obeys
    "charger_silent": "{port}의 충전기가 상태 요청 {misses}회에 응답하지 않았습니다",
    "charger_stale": "{port}의 충전기가 {limit_s:g}초 동안 상태를 회신하지 않았습니다",
    "found_running": "기동 명령이 없었는데 충전기가 동작 중이었습니다",
    "rogue_run": "기동 명령이 없었는데 충전기가 {동작합니다|동작했습니다}: {charger_a:.2f} A",
    "current_unheard": "명령이 없었는데 BMU에 {pack_a:.2f} A의 충전 전류가 {보이며|보였으며}, 충전기는 응답하지 {않습니다|않았습니다}",
    "current_without_order": "명령이 없었는데 BMU에는 {pack_a:.2f} A의 충전 전류가 {보이고|보였고} 충전기는 {charger_a:.2f} A라고 "
    "{보고합니다|보고했습니다}. 충전기의 보고가 틀렸거나, 통신 케이블이 다른 베이의 것이거나, 다른 장치가 이 팩을 충전하고 있거나, "
    "BMU의 전류가 틀렸습니다",
    "will_not_stop": "충전기가 반복되는 정지 명령에 따르지 {않습니다|않았습니다}: {아직|그때까지} {charger_a:.2f} A를 {출력합니다|출력했습니다}",
    "stop_contradicted": "반복되는 정지가 한쪽에서만 {확인됩니다|확인되었습니다}: BMU에는 {아직|그때까지} {pack_a:.2f} A가 {보이고|보였고} 충전기는 "
    "{charger_a:.2f} A라고 {보고합니다|보고했습니다}. 둘 중 하나가 틀렸습니다",
    "did_not_stop": "{lasted_s:.0f}초 동안 정지 명령에 따르지 않았습니다",
    "stop_was_contradicted": "{lasted_s:.0f}초 동안 BMU에는 전류가 보이고 충전기는 전류가 없다고 했습니다: 둘 중 하나가 "
    "틀렸습니다",
    "will_not_start": "충전기에 '{command:word}' 명령을 {waited_s:.1f}초 동안 보냈으나 상태에 나타나지 {않습니다|않았습니다}{held:after}",
    "stopped_by_itself": "기동을 명령했는데 충전기가 정지했습니다",
    "stopped_not_full": "기동을 명령했는데 충전기가 정지했습니다. 전류가 줄어들지 않았고 팩이 종료 전압에 도달하지 "
    "않았으므로 모드 5를 충전 완료로 인정하지 {않습니다|않았습니다}",
    "stopped_not_asked": "기동을 명령했는데 충전기가 정지했습니다. 정책은 모드 5를 충전 완료로 인정하지 않습니다{at}",
    "setting_not_obeyed": "충전기에 '{command:word} {value}' 명령을 {waited_s:.1f}초 동안 보냈으나 상태에 나타나지 "
    "{않습니다|않았습니다}{held:after}",
    "held_back": "인터록이 명령을 막았습니다: {refused}",
    "limit_reverted": "충전기가 지령된 전류 제한 단계를 확인한 뒤 1분 안에 {times}회 스스로 되돌렸습니다",
    "above_step": "{step_a:g} A를 지령했는데 {charger_a:.2f} A가 {흐릅니다|흘렀습니다}(허용 {limit_a:.2f} A)",
    "over_current": "{charger_a:.2f} A가 {흐릅니다|흘렀습니다}. 전류 제한 {limit_a:g} A의 허용치 {allowed_a:.2f} A를 넘었습니다",
    "early_full": "충전기는 충전 완료(모드 5)를 {보고하지만|보고했지만} BMU의 SOC는 {soc_pct:.0f} {%입니다|%였습니다}",
    "open_circuit": "충전기가 {동작하지만|동작했지만} SOC {soc_pct:.0f} %에서 {idle_s:.0f}초 동안 전류가 흐르지 않았습니다",
    "no_battery": "충전기가 {lasted_min:.0f}분 동안 배터리를 찾고 {있습니다|있었습니다}",
    "wakes_too_long": "충전기가 {lasted_min:.0f}분 동안 회복 또는 프리차지 상태에 {있습니다|있었습니다}",
    "loose_plug": "충전 중에 배터리가 분리되었다가 곧바로 다시 연결되었습니다",
    # charger and battery side by side
    "over_voltage_charger": "충전기 전압이 {charger_v:.2f} V로 한계 {limit_v:g} V를 넘었습니다",
    "over_voltage_pack": "팩 전압이 {pack_v:.2f} V로 한계 {limit_v:g} V를 넘었습니다",
    "volts_disagree": "충전기는 {charger_v:.2f} V, BMU는 {pack_v:.2f} V라고 {합니다|했습니다}: 서로 다른 배터리이거나 접속이 "
    "{불량합니다|불량했습니다}{wrong:after}",
    "amps_disagree": "충전기는 {charger_a:.2f} A, BMU는 {pack_a:.2f} A라고 {합니다|했습니다}{wrong:after}",
    "bmu_likelier_wrong": "{by} 기준으로는 BMU가 틀렸을 가능성이 더 {높습니다|높았습니다}",
    "charger_likelier_wrong": "{by} 기준으로는 충전기가 틀렸을 가능성이 더 {높습니다|높았습니다}",
    "by_soc": "팩의 SOC",
    "by_step": "설정된 단계({step_a:g} A)",
    "moves_other": "{bay}의 충전기가 {other}의 BMU를 {움직입니다|움직였습니다}: {charger_a:.2f} A로 시작했으나 {bay}의 BMU에는 "
    "{seen_a:.2f} A만 {보입니다|보였습니다}. 두 베이의 케이블 또는 노드 ID가 서로 바뀌었습니다",
    "pairing_not_proved": "{bay}의 충전기가 {charger_a:.2f} A로 시작했으나 그 BMU(노드 0x{node_id:02X})에는 {seen_a:.2f} A만 "
    "{보입니다|보였습니다}: 같은 배터리에 연결되어 있지 {않습니다|않았습니다}",
    "charger_frozen": "BMU의 값이 {moved_v:.2f} V, {moved_a:.2f} A 변하는 동안 충전기는 {lasted_s:.0f}초째 "
    "{charger_v:.2f} V, {charger_a:.2f} A라고만 {합니다|했습니다}: 충전기의 측정값이 멈추었습니다",
    "charger_frozen_at_rest": "대기 중 BMU의 전압이 {moved_v:.2f} V 변하는 동안 충전기는 {lasted_s:.0f}초째 "
    "{charger_v:.2f} V라고만 {합니다|했습니다}: 충전기의 측정값이 멈추었습니다",
    "bmu_still_frozen": "BMU의 모든 값이 {lasted_s:.0f}초째 {그대로입니다|그대로였습니다}: 값이 멈추었습니다",
    "bmu_frozen": "충전기 전압이 {moved_v:.2f} V 변하고 {moved_ah:.2f} Ah가 충전되는 동안 BMU의 모든 값이 "
    "{lasted_s:.0f}초째 {그대로입니다|그대로였습니다}: 값이 멈추었습니다",
    "pack_sunk": "충전 중에 팩 전압이 {floor_v:g} V 아래인 {pack_v:.2f} V까지 내려갔습니다{at}",
    "pack_stays_low": "충전 중에 팩 전압이 떨어진 뒤 {pack_v:.2f} V로 {floor_v:g} V보다 {낮습니다|낮았습니다}{at}",
    "pack_fell": "{pack_a:.2f} A가 흐르는 동안 팩 전압이 {passed_s:.0f}초 안에 {before_v:.2f} V에서 {pack_v:.2f} V로 "
    "떨어졌습니다: 셀 또는 접점에 이상이 있습니다",
    "back_feed": "충전기가 동작하는 동안 BMU가 {discharge_a:.2f} A의 방전을 {보고합니다|보고했습니다}",
    # the battery
    "bmu_silent": "BMU(노드 0x{node_id:02X})가 더 이상 응답하지 {않습니다|않았습니다}",
    "heartbeat_lost": "BMU의 heartbeat가 {age_s:.1f}초 동안 {없습니다|없었습니다}",
    "stale_reading": "BMU의 최신 값이 {없습니다|없었습니다}: {missing:word}",
    "not_operational": "BMU의 NMT 상태가 operational이 아닌 {nmt_state:word}{입니다|이었습니다}: TPDO를 보내지 않고 NMT start에도 따르지 "
    "{않습니다|않았습니다}",
    "bmu_rebooted": "충전 중에 BMU가 리부팅되었습니다: 처음부터 다시 확인해야 합니다",
    "status_trip": "BMU가 {bits:word}을(를) {보고합니다|보고했습니다}(상태 워드 0x{status:04X})",
    "status_limit": "BMU가 {bits:word}을(를) {보고합니다|보고했습니다}(상태 워드 0x{status:04X})",
    "hot_trip": "팩 온도가 {pack_c:.1f} °C로 {limit_c:g} °C {이상입니다|이상이었습니다}{at}",
    "over_temperature": "팩 온도가 {pack_c:.1f} {°C이고|°C였고} 상한은 {limit_c:g} °C입니다{at}. {again_c:g} °C 아래에서 다시 "
    "충전합니다",
    "under_temperature": "팩 온도가 {pack_c:.1f} {°C이고|°C였고} 하한은 {limit_c:g} °C입니다{at}. {again_c:g} °C부터 다시 충전합니다",
    "runaway": "팩 온도가 분당 {rate_k_per_min:.2f} K씩 {올라갑니다|올라갔습니다}(한계 {limit_k_per_min:g} K/min)",
    "temperature_jump": "팩 온도가 {passed_s:.2f}초 사이에 {before_c:.1f} °C에서 {pack_c:.1f} °C로 변했습니다",
    "under_voltage": "팩 전압이 {pack_v:.2f} V로 {limit_v:g} V보다 {낮습니다|낮았습니다}{at}",
    "needs_precharge": "BMU가 저전압을 {보고하지만|보고했지만} 정책에 프리차지 항목이 {없습니다|없었습니다}",
    "soh_low": "SOH가 {soh_pct:.0f} %로 {limit_pct:g} %보다 {낮습니다|낮았습니다}{at}",
    "soc_step": "SOC가 {passed_s:.0f}초 사이에 {before_pct:.0f} %에서 {soc_pct:.0f} %로 변했습니다",
    "soc_falls": "충전 중인데 SOC가 {passed_min:.0f}분 동안 {peak_pct:.0f} %에서 {soc_pct:.0f} %로 내려갔습니다",
    "energy_disagrees": "BMU의 잔여 용량 {remaining_ah:.2f} Ah와 가용 에너지 {available_wh:.1f} Wh는 {implied_v:.1f} V에 "
    "{해당하지만|해당했지만} 팩 전압은 {pack_v:.2f} {V입니다|V였습니다}",
    "time_to_full_disagrees": "BMU의 완충 예상 시간 {full_min:.0f}분은 {takes_ah:.1f} Ah에 해당하지만, SOC {soc_pct:.0f} "
    "%에서 {remaining_ah:.2f} Ah라면 {missing_ah:.1f} Ah가 부족한 {것입니다|것이었습니다}",
    "soc_not_believed": "{whats}",
    "other_serial": "BMU의 일련번호가 {serial}입니다. 이전 번호는 {before}였습니다: 다른 배터리입니다",
    "battery_exchanged": "{what}. 그 사이 BMU의 응답이 없었습니다: 다른 배터리일 수 있습니다",
    "pack_too_low": "팩 전압이 SOC {soc_pct:.0f} %에서 {pack_v:.2f} {V입니다|V였습니다}: {kind} 셀 {cells}직렬{at}이면 셀당 "
    "{cell_v:.2f} V인데, 이 SOC에서는 {bound_v:.2f} V 이상이어야 합니다. 다른 종류의 팩이거나 SOC가 틀렸습니다",
    "pack_too_high": "팩 전압이 SOC {soc_pct:.0f} %에서 {pack_v:.2f} {V입니다|V였습니다}: {kind} 셀 {cells}직렬{at}이면 셀당 "
    "{cell_v:.2f} V인데, 이 SOC에서는 {bound_v:.2f} V 이하여야 합니다. 다른 종류의 팩이거나 SOC가 틀렸습니다",
    "below_lowest_step": "{rule}. 이 충전기의 가장 낮은 단계는 {lowest_a:g} A입니다",
    "precharge_too_strong": "팩 전압이 {pack_v:.2f} V이므로 {max_a:g} A 이하의 프리차지가 {필요합니다|필요했습니다}{at}. 이 충전기의 가장 "
    "낮은 단계는 {lowest_a:g} A입니다",
    # others on the bus
    # the charge
    "precharge_no_rise": "팩 전압이 {lasted_min:.1f}분 동안 {rise_v:.2f} V 올랐습니다. {expected_v:g} V가 올라야 합니다{at}",
    "precharge_too_long": "연속 프리차지가 {lasted_min:.1f}분 걸렸는데 팩 전압이 아직 {below_v:g} V {아래입니다|아래였습니다}{at}",
    "time_limit": "충전 시간이 {lasted_h:.2f}시간에 이르렀습니다{at}",
    "ah_limit": "SOC {begun_pct:.0f} %부터 {charged_ah:.2f} Ah가 충전되었습니다: 전체 충전의 한계가 {whole_ah:g} Ah이므로"
    "{at} 여기서는 {limit_ah:.2f} Ah까지입니다",
    # ourselves
    "late": "이 베이의 점검이 {late_s:.2f}초 늦었습니다",
    "overrun": "이 베이가 {late_s:.1f}초 동안 점검되지 않았습니다: 컴퓨터가 멈추어 있었습니다",
    "suspended": "컴퓨터가 {slept_s:.0f}초 동안 절전 상태였습니다: 이 베이에 대해 알던 것은 더 이상 유효하지 {않습니다|않았습니다}",
    "supply_failed": "전원을 나눌 수 없어 더 이상 배정하지 않습니다: {error}",
    "internal": "{whats}",
    "internal_error": "{error}",
    "not_judged": "{fault} 장애를 판정할 수 {없습니다|없었습니다}: {error}",
}
