"""What the service reports about itself: its disk, its guardian, its end, and its answers to requests."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    # why it ends
    "signal": "{name}",
    "guardian_died": "감시 프로세스(guardian)가 종료되었습니다",
    "guardian_silent": "감시 프로세스(guardian)가 {limit_s:g}초 동안 응답하지 않았습니다",
    "guardian_full": "감시 프로세스(guardian)가 메시지를 받지 않습니다",
    "ending": "{why}: 모든 베이를 정지하고 있습니다",
    "ended": "종료했습니다: {verdicts:then}",
    "ended_well": "종료했습니다: 모든 충전기의 대기 상태를 확인했습니다",
    "not_verified": "대기 상태가 확인되지 않은 충전기: {chargers:word}",
    "not_written": "저장되지 않았습니다: {problem}",
    # its disk
    "would_forget": "재시작하면 변경 내용을 잃습니다: {problem}",
    "disk_failed": "{file}에 쓸 수 없습니다: {error:word}",
    "disk_slow": "{file}을(를) {limit_s:g}초 안에 쓰지 못했습니다",
    "disk_hangs": "{file}을(를) {limit_s:g}초 안에 쓰지 못했습니다: 디스크가 멈추어 있습니다",
    "disk_silent": "{directory}의 디스크가 응답하지 않습니다",
    "restart_then": "응답하면 서비스를 재시작하십시오",
    "disk_internal": "내부 에러: {error}",
    "directory_taken": "다른 서비스가 {directory}에 상태를 저장하고 있습니다: 먼저 그 서비스를 정지하거나 이 스테이션에 별도의 "
    "journal.directory를 지정하십시오",
    "journal_dead": "저널이 기록되지 않고 있습니다",
    "journal_hangs": "저널이 {lasted_s:.0f}초 동안 기록되지 않았습니다: 디스크가 멈추어 있습니다",
    "journal_failed": "저널을 기록할 수 없습니다: {error:word}: {file}",
    "journal_again": "저널이 다시 기록되고 있습니다",
    # its output on standard error
    "service_begins": "{station}: 베이 {bays}개, 제어 소켓 {socket}",
    "lines_left_out": "(제때 읽지 않아 {lines}줄을 생략했습니다)",
    "bay_begins": "{bay}: {state}: {reason}",
    "bay_goes": "{bay}: {before} → {state}: {reason}",
    "bay_internal": "{bay}: 내부 에러로 정지하고 있습니다: {error}",
    "socket_stranger": "제어 소켓: 사용자 {uid}의 접속을 거절했습니다(프로세스 {pid}, 지난 알림 이후 {times}회)",
    "socket_internal": "제어 소켓: 내부 에러로 접속을 모두 끊었습니다: {error}",
    "socket_taken": "제어 소켓: {socket}을(를) 지금은 다른 프로그램이 사용합니다: 그 프로그램을 종료하거나 이 서비스를 "
    "재시작하십시오",
    "socket_lost": "제어 소켓: {socket}이(가) 삭제되었습니다: {error}",
    "socket_again": "제어 소켓: {socket}이(가) 삭제되어 다시 만들었습니다",
    "socket_occupied": "{socket}이(가) 이미 있고 소켓이 아닙니다: 이 스테이션에 다른 control.socket을 지정하십시오",
    "socket_answered": "다른 서비스가 {socket}에서 응답합니다: 먼저 그 서비스를 정지하거나 이 스테이션에 다른 "
    "control.socket을 지정하십시오",
    "socket_failed": "제어 소켓 {socket}을(를) 열 수 없습니다: {error:word}",
    "files_limited": "동시에 열 수 있는 파일이 최대 {limit}개인데 이 스테이션에는 {needed}개가 필요합니다: unit의 "
    "LimitNOFILE= 또는 ulimit -n을 올리십시오",
    # chargers that no longer belong to a bay
    "stray": "{port}의 {bay}",
    "stray_found": "{port}의 {bay}: 스테이션 파일에 이 포트의 베이가 없으나 충전기가 동작 중일 수 있어 정지하고 있습니다",
    "stray_verified": "{port}의 {bay}: 대기 상태를 확인했습니다. 스테이션 파일에 베이가 없는 이유를 확인하십시오",
    "stray_runs": "{port}의 {bay}: 충전기가 다시 동작하여 정지하고 있습니다",
    "stray_dropped": "{port}의 {bay}: 작업자가 제외했습니다. 이 충전기는 완전히 철거되었습니다",
    "stray_answers": "{port}의 {bay}: 충전기가 응답하므로 철거되지 않았습니다. 정지하고 있습니다",
    "stray_unknown": "{port}: 여기에는 확인을 기다리는, 베이 없는 충전기가 없습니다(기다리는 곳: {ports:word})",
    "stray_none": "{port}: 여기에도 다른 곳에도 확인을 기다리는, 베이 없는 충전기가 없습니다",
    # a changed policy
    "reload": "{bay}: 다시 읽기: {what}",
    "reload_refused": "{findings}\n{file}: 다시 읽기를 거절했습니다. 모든 정책은 그대로입니다",
    "reload_failed": "{file}: 다시 읽지 못했습니다. 모든 정책은 그대로입니다: {error}",
    "policy": "정책 {policy}({file}, sha256 {sha256})",
    "policy_unchanged": "{policy}: 바뀌지 않았습니다",
    "policy_offered": "{policy}: 베이가 대기 상태가 되면 적용됩니다",
    "policy_in_force": "{bay}: {policy}이(가) 적용되었습니다",
    "needs_restart": "스테이션 파일에서 이 베이가 바뀌었습니다: 서비스를 재시작해야 적용됩니다",
    # answers to requests
    "accepted": "{bay}: {verb} 요청을 수락했습니다",
    "accepted_verified": "{bay}: {verb} 요청을 수락했습니다. 대기 상태를 확인했습니다",
    "bay_refused": "{bay}: {why}",
    "not_seen_to_stop": "{bay}: 대기 상태가 확인되지 않았습니다. `orchestrator estop`을 실행하십시오: {error}",
    "bay_unknown": "'{bay}' 베이가 없습니다: {bays}",
    "done_nowhere": "어느 베이에서도 {verb}을(를) 실행하지 않았습니다",
    "verb_unknown": "알 수 없는 명령입니다: {verb}. 가능한 명령: {verbs}",
    "bays_no_list": "'bays'는 이름의 목록이거나, 전체를 뜻하는 null이어야 합니다",
    "request_too_long": "요청은 최대 {limit}바이트의 한 줄이어야 합니다",
    "request_no_object": "요청은 한 줄의 JSON 객체 하나여야 합니다",
    "owner_only": "서비스의 소유자만 이 소켓을 사용할 수 있습니다",
    "too_many_requests": "요청이 한꺼번에 너무 많습니다: 다시 요청하십시오",
    "request_internal": "내부 에러: {error}",
    "request_unanswered": "내부 에러: 응답이 없습니다",
    "dropped_not_persisted": "제외했으나 저장되지 않았습니다: {problem}",
    # around the table of the status
    "alarm": "경보: {what}",
    "warning": "경고: {what}",
    "old": "이전 값: {what}",
    "policy_note": "정책: {what}",
    "see_alarm": "경보를 확인하십시오",
    "old_figure": "{figure}(이전 값)",
}
