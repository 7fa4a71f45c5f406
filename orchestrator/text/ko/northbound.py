"""What the page's server tells: where it is, who may come in, and why a request is refused."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    "page_served": "이 스테이션의 페이지: {address}",
    "listen_failed": "{address}에서 연결을 받을 수 없습니다: {error}",
    "certificate_wrong": "{cert_file}과(와) {key_file}을(를) 인증서와 키로 사용할 수 없습니다: {error}",
    "certificate_kept": "사용 중인 인증서를 그대로 사용합니다: {why}",
    "users_doubted": "사용자 파일을 사용할 수 없습니다: {why}. 바로잡을 때까지 아무도 로그인할 수 없으며 운전자는 정지와 일시 "
    "정지만 할 수 있습니다",
    "users_trusted": "사용자 파일이 다시 정상입니다. 파일의 내용을 적용합니다",
    "users_none": "{file}에 사용자가 없습니다. 모두 로그아웃되었으며 아무도 로그인할 수 없습니다",
    "users_unsure": "사용자 파일을 사용할 수 없습니다(원인은 페이지 서버의 로그 참조). 바로잡을 때까지 로그인할 수 없으며 정지와 "
    "일시 정지만 전달합니다",
    "page_error": "페이지 서버의 자체 오류({path}): {error}",
    "user_saved": "{name} 사용자가 {role} 역할로 로그인할 수 있습니다({file})",
    "users_not_written": "{file}을(를) 쓸 수 없어 아무것도 바꾸지 않았습니다: {error}",
    "password_for": "{name} 사용자의 비밀번호",
    "password_again": "비밀번호 다시 입력",
    "login_done": "{name}({role}) 사용자가 {address}에서 로그인했습니다",
    "login_failed": "{address}에서 {name} 사용자의 로그인이 실패했습니다",
    "login_needed": "먼저 로그인하십시오",
    "login_wrong": "이름 또는 비밀번호가 맞지 않습니다",
    "login_wait": "로그인 실패가 너무 많습니다. {wait_s:.0f}초 후에 다시 시도하십시오",
    "login_none": "이 페이지에는 사용자가 없으므로 로그인할 필요가 없습니다",
    "role_too_low": "{name} 사용자는 조회만 할 수 있습니다. 이 작업에는 operator 역할이 필요합니다",
    "host_unknown": "이 서버의 이름은 {host}이(가) 아닙니다. 서버의 주소를 사용하거나 설정 파일의 page.hosts에 이름을 추가하십시오",
    "origin_foreign": "다른 페이지에서 온 요청은 거부됩니다({origin})",
    "nothing_here": "이 주소에는 아무것도 없습니다",
    "method_wrong": "이 주소는 {method} 메서드를 받지 않습니다",
    "type_not_json": "요청의 콘텐츠 형식은 {type}이(가) 아니라 application/json이어야 합니다",
    "head_wrong": "HTTP 요청이 아니거나 머리 부분이 {limit}바이트를 넘습니다",
    "body_too_long": "요청이 {limit}바이트를 넘습니다",
    "body_late": "요청이 {limit_s:g}초 안에 도착하지 않았습니다",
    "field_wrong": "{name}: {wanted} 형식이어야 합니다",
    "streams_taken": "실시간 스트림 {most}개가 모두 사용 중입니다. 보지 않는 페이지를 닫으십시오",
    "page_busy": "요청이 너무 많습니다. 몇 초 후에 다시 시도하십시오",
    "page_late": "응답이 너무 오래 걸립니다. 다시 시도하거나 범위를 줄이십시오",
    "page_failed": "페이지 서버에 오류가 발생했으며 로그에 기록되었습니다. 스테이션에는 영향이 없습니다",
    "answer_odd": "응답을 이해할 수 없습니다",
    "bay_odd": "컨트롤러가 보낸 {bay}의 정보를 이해할 수 없습니다",
    "asker_gone": "요청한 쪽의 연결이 끊어져 요청을 전달하지 않았습니다",
    "bay_changed": "버튼을 누른 뒤 {bay}의 상태가 바뀌어 요청을 전달하지 않았습니다. 다시 확인하십시오",
    "page_stood_still": "페이지 서버가 잠시 멈춰 있었으므로 요청을 전달하지 않았습니다. 상태를 확인하고 다시 누르십시오",
    "controller_silent": "컨트롤러가 응답하지 않습니다({why}). 요청이 처리되지 않았을 수 있습니다. 게이트웨이에서 `orchestrator estop`을 "
    "실행하면 모든 충전기가 정지합니다",
}
