"""Problems of ports and buses, devices that answer badly, and others on the line."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    # a charger's serial port
    "port_not_opened": "{port}: 아직 열지 않았습니다",
    "port_opened": "{port}: 열었으나 아직 응답이 없습니다",
    "port_missing": "{port}: 포트가 없습니다: 어댑터가 연결되어 있는지, 이름이 맞는지(ls -l /dev/serial/by-path) 확인하십시오",
    "port_gone": "{port}: 어댑터가 분리되었거나 전원이 꺼졌거나, 다른 프로그램이 이 포트를 읽고 있습니다. 다시 연결하십시오",
    "port_busy": "{port}: 사용 중입니다: 다른 프로그램이 점유하고 있거나 두 베이가 같은 포트를 지정했습니다. 다른 쪽을 "
    "닫으십시오(lsof로 확인)",
    "port_of_service": "{port}: 다른 서비스(pid {pid})가 이 포트를 점유하고 충전기를 제어합니다: 둘 중 하나를 종료하거나 이 "
    "포트를 한 스테이션 파일에만 지정하십시오",
    "port_forbidden": "{port}: 권한이 없습니다: 실행 사용자를 dialout 그룹에 추가한 뒤 다시 로그인하십시오",
    "port_not_serial": "{port}: 시리얼 포트가 아닙니다: 스테이션 파일의 이름을 확인하십시오(ls -l /dev/serial/by-path)",
    "port_stubborn": "{port}: 드라이버가 충전기의 설정({baud} baud 8N1)을 받아들이지 않습니다. 다른 어댑터를 "
    "사용하십시오({found:word})",
    "port_stalled": "{port}: {limit_s:g}초 동안 아무것도 받아들이지 않습니다. 어댑터를 뽑았다가 다시 꽂으십시오",
    "port_taken": "{port}: 다른 프로그램이 이 포트를 독점으로 열어(TIOCEXCL) 아무도 이 충전기를 정지할 수 없습니다: 그 "
    "프로그램을 종료하거나 충전기의 주전원을 차단하십시오{program:after}",
    "port_too_many_files": "{port}: 열린 파일이 너무 많습니다: 서비스의 한계(LimitNOFILE)를 올리십시오",
    "port_not_rs485": "{port}: 드라이버가 RS-485 회선의 방향을 전환하지 못합니다(rs485: kernel). 스스로 전환하는 어댑터를 "
    "rs485: off로 사용하십시오",
    "port_failed": "{port}: 열 수 없습니다({error:word})",
    # a charger that answers badly or not at all
    "charger_no_reply": "{port}: 응답이 {없습니다|없었습니다}: 충전기의 전원과 케이블, 뒤바뀐 배선(RX와 TX, 또는 +와 −)을 확인하십시오",
    "charger_noise": "{port}: 깨진 프레임만 {수신됩니다|수신되었습니다}: 케이블의 차폐, 접지, 종단 저항과 19200 8N1을 확인하십시오",
    "charger_complains": "{port}: 에러 프레임으로만 {응답합니다|응답했습니다}: 케이블의 차폐, 접지, 종단 저항을 확인하십시오",
    "charger_late": "{port}: {응답하지만|응답했지만} 제시간에 오지 않거나 요청과 {다릅니다|달랐습니다}: 통신선에 느린 변환기가 있는지 확인하십시오",
    "charger_internal": "{port}: 내부 에러: {error}",
    "undocumented": "{value:word} {raw}(규격: {documented})",
    # others at its port
    "settings_found": "{found:word}",
    "baud": "{baud} baud",
    "line_discipline": "회선 규칙(line discipline) {number}",
    "program": "{name} (pid {pid})",
    "program_unknown": "알 수 없는 프로그램",
    # frames that the interlock held back
    "no_command": "'{command:word} {value}' 명령은 {control:word} 모드의 충전기에 보낼 수 없습니다",
    "no_grant": "{command:word}: 충전기, 팩 전압, 팩 온도의 최신 값이 없습니다",
    "not_on_disk": "{command:word}: 이 충전기가 동작할 수 있다는 사실이 디스크에 기록되지 않았습니다",
    "grant_old": "{command:word}: 근거가 되는 값이 {age_s:.1f}초만큼 오래되었습니다",
    "above_station_v": "{command:word}: {voltage_v:g} V는 스테이션의 한계 {limit_v:g} V를 넘습니다",
    "outside_station_c": "{command:word}: {pack_c:g} °C는 스테이션의 범위 {low_c:g} … {high_c:g} °C를 벗어납니다",
    "step_unknown": "{command:word}: 충전기의 전류 제한 {step:d}의 의미를 알 수 없습니다",
    "above_station_a": "{command:word}: 단계 {step}은(는) {step_a:g} A로 스테이션의 한계 {limit_a:g} A를 넘습니다",
    "above_supply": "{command:word}: 단계 {step}은(는) 전원이 배정한 {granted}을(를) 넘습니다",
    # a contactor's GPIO line
    "gpio_missing": "{chip} 라인 {line}: GPIO 칩이 없습니다: 스테이션 파일의 이름을 확인하십시오(gpiodetect로 확인)",
    "gpio_forbidden": "{chip} 라인 {line}: 권한이 없습니다: 실행 사용자를 칩의 그룹(ls -l로 확인)에 추가한 뒤 다시 "
    "로그인하십시오",
    "gpio_busy": "{chip} 라인 {line}: 사용 중입니다: 다른 프로그램이나 커널 드라이버가 라인을 점유하고 있습니다(gpioinfo로 "
    "확인)",
    "gpio_no_line": "{chip} 라인 {line}: 그런 라인이 없거나 출력으로 쓸 수 없습니다(gpioinfo로 확인)",
    "gpio_gone": "{chip} 라인 {line}: GPIO 칩이 아니거나 없어졌습니다: 이름을 확인하거나(gpiodetect로 확인) 어댑터를 다시 "
    "연결하십시오",
    "gpio_failed": "{chip} 라인 {line}: 구동할 수 없습니다({error:word})",
    "gpio_not_installed": "스테이션 파일의 접촉기에는 gpiod 패키지가 필요합니다: {install}",
    # a CAN bus
    "can_bus": "CAN 버스 {bus}({wire})",
    "can_not_open": "열려 있지 않습니다",
    "can_down": "{error:word}: 인터페이스가 내려가 있습니다. 올리십시오: {command}",
    "can_no_interface": "{error:word}: 그런 인터페이스가 없습니다: 어댑터가 연결되어 있습니까? `ip link`로 확인하십시오",
    "can_gone": "{error:word}: 어댑터가 없어졌습니다: 다시 연결하십시오",
    "can_no_device": "{error:word}: 그런 장치가 없습니다: 어댑터가 연결되어 있습니까? /dev/serial/by-path의 이름을 쓰는 것이 "
    "좋습니다",
    "can_forbidden": "{error:word}: 허용되지 않습니다: 서비스의 사용자에게 이 장치의 권한이 필요합니다(시리얼 어댑터는 "
    "dialout 그룹)",
    "can_not_serial": "{error:word}: 시리얼 포트가 아닙니다: 스테이션 파일의 channel을 확인하십시오",
    "can_busy": "{error:word}: 다른 프로그램이 점유하고 있습니다: 그 프로그램을 종료하십시오",
    "can_no_kernel": "{error:word}: 이 커널에는 raw CAN이 없습니다: modprobe can_raw를 실행하거나 다른 인터페이스를 쓰십시오",
    "can_queue_full": "송신 대기열이 가득 찼고 수신 확인이 없습니다: 케이블, 종단 저항, 비트 레이트, BMU의 전원을 확인하십시오",
    "can_failed": "{error:word}",
    "can_needs_msgpack": "udp_multicast에는 msgpack이 필요합니다: {install} ({error})",
    "can_stalled": "어댑터가 더 이상 아무것도 받아들이지 않습니다: 뽑았다가 다시 꽂으십시오({error})",
    "can_not_understood": "{error}: 스테이션 파일의 버스 설정과 인터페이스 드라이버의 설치를 확인하십시오",
    "can_internal": "CAN 버스 {bus}: 내부 에러: {error}",
    "can_bus_off": "컨트롤러가 bus-off입니다. 케이블, 종단 저항, 비트 레이트를 확인하십시오. 다음 설정에서만 스스로 "
    "복구합니다: {command}",
    "can_passive": "컨트롤러가 error-passive입니다: 케이블, 종단 저항, 비트 레이트를 확인하십시오",
    "can_no_ack": "프레임에 대한 수신 확인이 없습니다: BMU의 전원, 케이블, 비트 레이트를 확인하십시오",
    # a BMU that does not answer or is unreliable
    "bmu_not_asked": "{bus}의 BMU 0x{node_id:02X}: 아직 요청하지 않았습니다",
    "bmu_stopped": "{bus}의 BMU 0x{node_id:02X}이(가) 응답하지 {않습니다|않았습니다}: NMT 명령으로 정지되었습니다. NMT start로 깨우십시오",
    "bmu_cut_off": "{bus}의 BMU 0x{node_id:02X}이(가) 응답하지 {않습니다|않았습니다}: {why}",
    "bmu_late": "{bus}의 BMU 0x{node_id:02X}이(가) 응답하지 {않습니다|않았습니다}: 응답이 {timeout_s:g}초(sdo_timeout_s)보다 "
    "{늦습니다|늦었습니다}. 버스의 부하와 에러를 확인하거나 스테이션 파일의 sdo_timeout_s를 늘리십시오",
    "bmu_garbled": "{bus}의 BMU 0x{node_id:02X}이(가) 응답하지 {않습니다|않았습니다}: 최신 응답을 해석할 수 {없습니다|없었습니다}: {why}",
    "bmu_unreachable": "{bus}의 BMU 0x{node_id:02X}이(가) 응답하지 {않습니다|않았습니다}: 전원, 케이블, 비트 레이트, 노드 스위치(노드 ID = "
    "스위치 + 0x10)를 확인하십시오",
    "bmu_doubled": "{bus}의 BMU 0x{node_id:02X}: 요청마다 응답이 두 번 {옵니다|왔습니다}: 두 BMU의 노드 ID가 같거나 다른 장치가 대신 "
    "응답합니다",
    "bmu_babbles": "{bus}의 BMU 0x{node_id:02X}: 1초에 {limit_hz}개가 넘는 프레임을 {보냅니다|보냈습니다}",
    "bmu_internal": "{bus}의 BMU 0x{node_id:02X}: 내부 에러: {error}",
    "sdo_length": "{size}바이트 프레임입니다. {expected}바이트여야 합니다: {data}",
    "sdo_command": "command 0x{command:02X}입니다. 43, 4B, 4F, 60, 80 중 하나여야 합니다: {data}",
    "sdo_abort": "0x{index:04X}:{sub:02X}에 대해 abort 0x{code:08X}을(를) 회신했습니다: {meaning:word}",
    "emcy": "BMU가 자체 에러를 {보고합니다|보고했습니다}: EMCY 0x{code:04X}, {meaning:word}({data})",
    # values that are not believed
    "value_outside": "{field:word} {value:g}은(는) {low:g} … {high:g} 범위를 {벗어납니다|벗어났습니다}(원시 값 {raw})",
    "size_differs": "0x{index:04X}:{sub:02X}의 크기가 {size}인데 오브젝트 맵에는 {expected}입니다",
    "tpdo_contradicts": "{field:word}: TPDO는 {tpdo:g}, SDO 읽기는 {sdo:g}{입니다|이었습니다}",
    "two_answers": "{field:word}: 한 요청에 두 응답이 왔습니다: {one}, {other}",
    "two_answers_elsewhere": "{field:word}: 한 요청에 두 응답이 왔고 {other:word} 값이 서로 다릅니다",
    "not_available": "값 없음",
    "a_refusal": "거부",
    # actions of another CANopen master
    "master_reads": "다른 CANopen 마스터가 0x{index:04X}:{sub:02X}을(를) {읽습니다|읽었습니다}",
    "master_writes": "다른 CANopen 마스터가 0x{index:04X}:{sub:02X}에 {씁니다|썼습니다}",
    "master_started": "다른 CANopen 마스터가 {whom:word}을(를) 시작시켰습니다(NMT)",
    "master_stopped": "다른 CANopen 마스터가 {whom:word}을(를) 정지시켰습니다(NMT)",
    "master_preoperational": "다른 CANopen 마스터가 {whom:word}을(를) pre-operational로 바꾸었습니다(NMT)",
    "master_reset": "다른 CANopen 마스터가 {whom:word}을(를) 리셋했습니다(NMT)",
    "master_reset_communication": "다른 CANopen 마스터가 {whom:word}의 통신을 리셋했습니다(NMT)",
    "heartbeat_was_off": "BMU의 heartbeat가 꺼져 있었습니다: 다른 마스터가 껐거나 감지되지 않은 재시작입니다. 다시 "
    "{period_s:g}초로 설정합니다",
    "heartbeat_was": "다른 마스터가 BMU의 heartbeat를 {found_s:g}초로 바꾸었습니다. 다시 {period_s:g}초로 설정합니다",
}
