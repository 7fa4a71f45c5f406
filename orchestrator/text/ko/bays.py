"""Why a bay is where it is, and what becomes of requests."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    "said": "{text}",
    "several": "{whats}",
    # the service
    "service_started": "서비스가 방금 시작되었습니다",
    "service_ends": "서비스가 종료됩니다: {why}",
    "no_answer": "제어 루프가 응답하지 않았습니다: 서비스의 로그를 확인하십시오",
    "not_kept": "수행했으나 저장되지 않았습니다: {problem}",
    "not_done": "수행하지 않았습니다: {problem}",
    "not_taken": "디스크가 아직 받아들이지 않았습니다",
    "overtaken": "그 사이에 정지 요청이 있었습니다: 여전히 필요하면 다시 요청하십시오",
    # where a bay without a charge is
    "charger_offline": "{port}의 충전기가 응답하지 않습니다",
    "stopped_first": "다른 무엇보다 먼저 충전기를 정지하고 있습니다",
    "runs_uncommanded": "기동 명령이 없었는데 충전기가 동작합니다",
    "battery_absent": "배터리가 없습니다",
    "battery_not_heard": "충전기에 {charger_v:.1f} V가 있으나 {what}",
    "bmu_just_booted": "BMU(노드 0x{node_id:02X})가 방금 부팅되었습니다",
    "bmu_does_not_answer": "BMU(노드 0x{node_id:02X})가 응답하지 않습니다",
    "soc_unknown": "배터리가 있으나 아직 SOC를 알 수 없습니다",
    "soc_below": "SOC {soc_pct:.0f} %가 {threshold_pct:g} %보다 낮습니다{at}",
    "soc_not_below": "SOC {soc_pct:.0f} %가 {threshold_pct:g} % 이상입니다{at}",
    "to_go_on": "계속하려면",
    "start_bay": "orchestrator start {bay}",
    # a charger that was not seen to stop
    "uncontrollable": "지금 이 충전기({port})의 주전원을 차단하십시오: {since_s:.0f} s 동안 정지 명령에 따르지 않습니다: {why}",
    "uncontrollable_unproved": "지금 이 충전기({port})의 주전원을 차단하십시오: {since_s:.0f} s 동안 정지가 확인되지 "
    "않았습니다: {why}",
    "uncontrollable_contradicted": "이 충전기({port})의 주전원을 차단하십시오: 충전기는 {charger_a:.2f} A라고 하고 BMU에는 "
    "아직 {pack_a:.1f} A가 보입니다. 둘 중 하나가 틀렸습니다. 주전원을 차단해도 BMU에 보이면 BMU를 재시작하십시오",
    "uncontrollable_stands_by": "이 충전기({port})가 계속 꺼져 있지 않으면 주전원을 차단하십시오: {lasts_s:.0f} s 동안 대기 "
    "상태입니다. {limit_s:g} s가 지나야 정지로 인정합니다",
    "witnesses": "{charger}{last:after}{bmu:after}",
    "no_answer_on": "{port}에서 응답이 없습니다",
    "last_heard": "마지막으로 {age_s:.0f} s 전에 {charger_a:.2f} A였습니다",
    "delivers": "충전기가 {charger_a:.2f} A를 출력합니다",
    "no_lasting_standby": "충전기의 상태가 지속되는 대기를 보이지 않습니다",
    "bmu_sees": "BMU에는 {pack_a:.1f} A가 보입니다",
    "bmu_not_heard": "BMU가 응답하지 않습니다",
    # what the table of the status adds
    "cut_mains_of": "{bay}의 충전기({port})의 주전원을 차단하십시오: {state}: {reason}",
    "cut_mains_of_stray": "{bay}의 것이었던 {port}의 충전기의 주전원을 차단하십시오: 동작 중일 수 있으며 대기 상태가 확인되지 "
    "않았습니다: {why}",
    "look_at": "{bay}의 충전기({port})를 확인하십시오. 대기 상태가 확인되지 않았습니다: {state}: {reason}",
    "port_unknown": "포트를 알 수 없음",
    "policy_waits": "변경된 정책은 이 베이가 대기 상태가 되면 적용됩니다",
    "old_charger": "충전기의 {charger_a:.2f} A는 {age:word} 전의 값입니다{bmu:after}",
    "old_values": "{names:word}: {age:word} 전의 값입니다",
    # while current flows
    "precharge_impossible": "프리차지 규칙이 없거나 팩 전압을 알 수 없습니다",
    "precharging_pulse": "팩 전압이 {below_v:g} V 아래입니다: 펄스 프리차지{at}",
    "precharging_continuous": "팩 전압이 {below_v:g} V 아래입니다: 연속 프리차지{at}",
    "pack_reached": "팩 전압이 {target_v:g} V에 도달했습니다{at}",
    "pulses_over": "펄스를 {limit_min:g}분 동안 주었습니다{at}",
    "full": "충전 완료: {what}",
    "full_soc": "SOC {soc_pct:.0f} %가 {limit_pct:g} %에 도달했습니다{at}",
    "full_charger": "충전기가 충전 완료(모드 5)를 보고합니다{at}",
    "full_taper": "전류가 {for_s:g} s 동안 {below_a:g} A 아래로 줄어 {charger_a:.2f} A입니다{at}",
    "charging": "단계 {step}({step_a:.1f} A): {rule}{limited:after}{rises:after}{held:after}",
    "held_at_the_top": "충전이 완료되어 앞으로 {left_min:.0f}분 동안 유지합니다{at}",
    "not_held_yet": "팩이 완충되었으나 아직 {hold_min:g}분 동안 유지하지 않았습니다{at}",
    "not_known_full": "충전이 중단되었고 팩이 완충되었는지 알 수 없습니다{at}",
    "full_held": "{what}, {hold_min:g}분 동안 유지했습니다{at}",
    "full_by_all": "{whats:and}",
    "rises": "더 높은 단계가 허용되어 {hold_s:g} s 후에 적용됩니다{at}",
    "charges_by_itself": "충전기가 스스로 충전합니다(자동 모드)",
    "precharge_step": "프리차지는 항상 가장 낮은 단계로 합니다",
    # before a charge
    "checking": "충전 전에 충전기와 배터리를 확인하고 있습니다",
    "writing_down": "재시작 후에도 알 수 있도록 충전 시작을 기록하고 있습니다",
    "needs_pulses": "팩 전압이 {pack_v:.2f} V로 {below_v:g} V보다 낮습니다{at}",
    "qualified": "확인 완료: {pack_v:.2f} V, SOC {soc_pct:.0f} %, {pack_c:.1f} °C",
    "waits_for_values": "최신 값을 기다리고 있습니다: {missing:word}",
    "waits_for_contactor": "접촉기를 기다리고 있습니다. 닫히기 전에는 충전기와 배터리를 비교할 수 없습니다",
    "waits_for_turn": "차례를 기다리고 있습니다: {other}이(가) 충전을 시작하고 있습니다",
    "waits_for_stagger": "차례를 기다리고 있습니다: 이 스테이션의 충전은 {stagger_s:g} s 간격으로 시작합니다{at}",
    # requests
    "operator_stop": "작업자가 정지했습니다",
    "operator_pause": "작업자가 일시 정지했습니다",
    "operator_reset": "작업자가 리셋했습니다",
    "not_running": "동작 중이 아닙니다: {what}",
    "out_of_control": "충전기의 정지가 확인되지 않았습니다: 주전원을 차단하십시오. {lasts_s:g} s 동안 대기 상태가 유지되기 "
    "전에는 시작도 리셋도 할 수 없습니다",
    "reset_first": "동작 중이 아닙니다: 먼저 {faults}을(를) 리셋해야 합니다",
    "nothing_to_start": "시작할 것이 없습니다: {state}: {what}",
    "nothing_to_reset": "리셋할 것이 없습니다: {state}: {what}",
    "needs_reset": "{fault} 장애가 래치되어 리셋이 필요합니다: {what}",
    "still_there": "{fault} 장애가 아직 남아 있습니다: {what}",
    "gone_first": "먼저 {fault} 장애가 {clean_s:g} s 동안 없어야 합니다",
    "reset_too_often": "{fault} 장애를 1시간 안에 {times}회 리셋했으나 매번 다시 발생했습니다: 원인을 제거하십시오. "
    "{wait_min:.0f}분 후에 다시 리셋할 수 있습니다",
    # how a fault goes on
    "goes_on_by_reset": "원인이 사라졌습니다: orchestrator reset {bay}, 이어서 orchestrator start {bay}",
    "goes_on_after": "원인이 사라지고 {wait_s:g} s 후에 스스로 계속합니다(1시간 내 {of}회 중 {strike:nth}회째)",
    "goes_on_in": "원인이 사라졌고 {left_s} s 후에 스스로 계속합니다(1시간 내 {of}회 중 {strike:nth}회째)",
    "goes_on_in_at_the_earliest": "원인이 사라졌고 빨라도 {left_s} s 후에 스스로 계속합니다(1시간 내 {of}회 중 "
    "{strike:nth}회째)",
    # a defect of our own
    "failed": "내부 에러: {error}",
    "failed_stopping": "정지하고 있습니다: 내부 에러: {error}",
    "failed_uncontrollable": "이 충전기의 주전원을 차단하십시오: 소프트웨어가 {tried_s:.0f} s 동안 이 베이를 판정하지 "
    "못했고, 반복하는 정지를 확인할 수 없습니다({error})",
    "failed_request": "내부 에러: {error}. 소프트웨어 결함입니다. 충전기를 정지하고 있습니다",
    # what the last run has left
    "unfinished": "이 서비스의 지난 실행이 충전 중에 끝났습니다. 다시 시작할 때 먼저 충전기를 정지시켰습니다",
    "fault_of_another_version": "{fault}",
    "ended_in_charge": "지난 실행이 충전 중에 끝났습니다: {why}",
    "stray_ran": "충전기가 동작하는 동안 스테이션 파일에 {port}의 베이가 없었습니다",
    "past_unknown": "{port}의 {bay}이(가) {file}에 없습니다: 이전 상태를 알 수 없습니다",
    "older_version_ran": "그 사이에 이 서비스의 이전 버전이 {bay}을(를) 운전했습니다: 배선을 확인하십시오",
    "port_was_of": "{port}은(는) 지난 실행 때 {old_bay}의 것이었고 지금은 {bay}의 것입니다: 배선을 확인하십시오",
    "bmu_was_of": "{can}의 BMU(노드 0x{node_id:02X})는 지난 실행 때 {old_bay}의 것이었고 지금은 {bay}의 것입니다: 배선을 "
    "확인하십시오",
    "bay_moved_port": "{bay}은(는) 지난 실행 때 {old_port}에 있었고 지금은 {port}에 있습니다: 배선을 확인하십시오",
    "bay_moved_bmu": "{bay}의 BMU는 지난 실행 때 {old_can}의 노드 0x{old_node_id:02X}였고 지금은 {can}의 노드 0x{node_id:02X}입니다: "
    "배선을 확인하십시오",
    "state_unreadable": "{file}을(를) 읽을 수 없습니다({error:word}): 어떤 장애가 래치되어 있었는지 알 수 없습니다",
    "state_lost": "이 서비스가 여기서 실행된 적이 있는데 {file}이(가) 없습니다: 어떤 장애가 래치되어 있었는지 알 수 없습니다",
    "state_disk_silent": "{directory}의 디스크가 응답하지 않습니다: 어떤 장애가 래치되어 있었는지 알 수 없습니다",
}
