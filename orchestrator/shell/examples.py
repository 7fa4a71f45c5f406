"""Examples for each verb's `--help` and for the manual page: a command line, and what it does."""

from collections.abc import Mapping

Example = tuple[str, str]

EXAMPLES: Mapping[str, tuple[Example, ...]] = {
    "run": (
        ("run", "the station of station.yaml in this folder"),
        ("run /etc/orchestrator/station.yaml", "as systemd does"),
    ),
    "status": (
        ("status", "every bay in a table"),
        ("status bay-1", "everything about one bay"),
        ("status 'bay-0*' --except bay-03 --watch", "some bays, refreshed"),
        ("status --check --problems", "for scripts: exit status 1 if something needs a person"),
    ),
    "history": (
        ("history bay-2 --since 7d", "what happened at this bay last week"),
        ("history --station --limit 5", "the last beginnings, ends and failures of the station itself"),
    ),
    "sessions": (
        ("sessions --since 7d", "the charges of a week"),
        ("sessions show 4QZ7", "one of them: the end of its id will do"),
        ("sessions show 4QZ7 --html charge.html", "the same with its curve, as a web page"),
        ("sessions replay 4QZ7 --policy my-policy.yaml", "what another policy would have decided in it"),
        ("sessions --bay bay-2 --limit 10 --csv", "the last ten of a bay, for a spreadsheet"),
    ),
    "battery": (
        ("battery", "each battery that was charged, and where its id is from"),
        ("battery B-0042", "its life: charges, amounts, faults"),
    ),
    "report": (
        ("report", "the month of the newest charge"),
        ("report --month 2026-11 --html november.html", "a page to be sent"),
    ),
    "identify": (("identify bay-1 --battery B-0042", "what is written on the battery that was just connected"),),
    "start": (
        ("start bay-1", "let it charge after a stop, a pause or a reset"),
        ("start --all", "every bay that nobody else has stopped"),
        ("start --all --force --because 'floor is dry'", "those as well"),
        ("start bay-1 --to 100", "charge it once to 100 %, although the policy has another target"),
        ("start bay-1 --at 22:00", "let it start then; a stop before cancels that"),
    ),
    "pause": (
        ("pause --all --except bay-2", "all but one"),
        ("pause bay-1 --because 'cable is changed'", "whoever asks why reads this"),
    ),
    "stop": (
        ("stop bay-1 --because 'wet floor'", "until somebody starts it"),
        ("stop --all", "every bay, and wait until each charger stands by"),
    ),
    "reset": (
        ("reset bay-1", "clear its latched faults, then: orchestrator start bay-1"),
        ("reset --port /dev/ttyS3", "forget a charger that has no bay any more and is gone"),
    ),
    "reload": (
        ("reload", "after a policy was edited: what changed at which bay, and what waits"),
        ("reload --because 'new packs'", "with a reason for the journal"),
    ),
    "estop": (
        ("estop", "stop every charger of the station that is found, now"),
        ("estop /etc/orchestrator/station.yaml", "of this station"),
        ("estop --port /dev/charger/bay-1", "without any file"),
    ),
    "serve": (("serve northbound.yaml", "the page of a station; its first line says where"),),
    "user": (
        ("user add kim --role operator", "asks for the password twice"),
        ("user add screen --role viewer --file users.yaml", "who may look; < FILE takes the password from a file"),
    ),
    "check": (
        ("check station.yaml", "its policies and maps as well"),
        ("check my-policy.yaml --exhaustive", "also explore all that can happen under it"),
    ),
    "schema": (("schema policy", "for the completion of an editor"),),
    "decode": (
        ("decode AF FA 90 04 10 90 00 34 AF A0", "a frame, byte by byte"),
        ("decode --json AFFA900410900034AFA0", "the same, for programs"),
    ),
    "probe": (
        ("probe station.yaml", "every bay, before the service runs"),
        ("probe station.yaml --bay bay-2", "one bay"),
    ),
    "simulate": (
        ("simulate li-ion-48v my-policy.yaml --scenario warm-night", "two policies on one scenario"),
        (
            "simulate my-policy.yaml --scenario warm-night --sweep finish.target_soc_pct=80..100:5",
            "five values of a key",
        ),
    ),
    "replay": (
        ("replay /var/lib/orchestrator/journal --since 12h", "decide the last half day again"),
        ("replay /var/lib/orchestrator/journal --policy my-policy.yaml", "by another policy"),
    ),
    "diagram": (("diagram --policy my-policy.yaml --format svg --out states.svg", "the states with its thresholds"),),
    "demo": (
        ("demo", "a charge in about a minute"),
        ("demo --page", "the same, and in a browser"),
        ("demo --fault list", "the faults that can be injected"),
    ),
    "completion": (
        ("completion bash > ~/.local/share/bash-completion/completions/orchestrator", "for your next bash"),
        ("completion fish > ~/.config/fish/completions/orchestrator.fish", "for your next fish"),
    ),
    "manpage": (("manpage > orchestrator.1", "then: man ./orchestrator.1"),),
}


def epilog(verb: str) -> str:
    """The end of a verb's `--help`; "" without examples."""
    found = EXAMPLES.get(verb, ())
    lines = [line for command, what in found for line in (f"  orchestrator {command}", f"      {what}")]
    return "\n".join(["examples:", *lines]) if lines else ""
