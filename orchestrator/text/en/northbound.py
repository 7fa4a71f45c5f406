"""What the page's server tells: where it is, who may come in, and why a request is refused."""

from collections.abc import Mapping

TEXTS: Mapping[str, str] = {
    "page_served": "the page of this station: {address}",
    "listen_failed": "cannot listen at {address}: {error}",
    "certificate_wrong": "{cert_file} and {key_file} cannot be used as a certificate with its key: {error}",
    "certificate_kept": "the certificate in use stays: {why}",
    "users_doubted": "the file of users is of no use: {why}; until it is, nobody can log in, and operators can only stop "
    "and pause",
    "users_trusted": "the file of users is in order again: what it says holds",
    "users_none": "{file} names nobody: all are logged out, and nobody can log in",
    "users_unsure": "the file of users is of no use, as the log of the page's server says: until it is in order, nobody "
    "can log in, and only stop and pause are passed on",
    "page_error": "an error of the page's own at {path}: {error}",
    "user_saved": "{name} may log in as {role} ({file})",
    "users_not_written": "{file} cannot be written, nothing is changed: {error}",
    "password_for": "password for {name}",
    "password_again": "the same again",
    # who may come in
    "login_done": "{name} ({role}) has logged in from {address}",
    "login_failed": "a login as {name} from {address} has failed",
    "login_needed": "log in first",
    "login_wrong": "no user has this name and this password",
    "login_wait": "too many logins have failed: try again in {wait_s:.0f} s",
    "login_none": "this page has no users: nobody needs to log in",
    "role_too_low": "{name} may look, but not do this: it needs the role operator",
    "host_unknown": "this server is not called {host}: use its address, or add the name to page.hosts in its file",
    "origin_foreign": "a request from another page is refused ({origin})",
    # what was asked
    "nothing_here": "there is nothing at this address",
    "method_wrong": "this address does not answer to {method}",
    "type_not_json": "a request needs the content type application/json, not {type}",
    "head_wrong": "this is no HTTP request, or its head has more than {limit} bytes",
    "body_too_long": "the request has more than {limit} bytes",
    "body_late": "the request has not arrived within {limit_s:g} s",
    "field_wrong": "{name}: expected is {wanted}",
    "streams_taken": "all {most} live streams are in use: close pages that nobody looks at",
    "page_busy": "too much is asked at once: try again in a few seconds",
    "page_late": "the answer takes too long: try again, or ask for less",
    "page_failed": "the page's server has made an error, which its log has; the station is not affected",
    "answer_odd": "its answer is nothing that this server understands",
    "bay_odd": "what the controller tells of {bay} is nothing that this server understands",
    "asker_gone": "whoever asked this has left: it is not passed on",
    "bay_changed": "{bay} has changed since this was pressed, so it is not passed on: look again",
    "page_stood_still": "the page's server stood still, so this is not passed on: look again, then press again",
    "controller_silent": "the controller does not answer ({why}): do not rely on this having been done; `orchestrator estop` "
    "on the gateway stops every charger",
}
