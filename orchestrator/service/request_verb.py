"""`orchestrator start`, `pause`, `stop` and `reset`: a person's requests to bays."""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

from orchestrator.errors import ServiceError, UsageError
from orchestrator.lastresort.asking import ask
from orchestrator.lastresort.signing import signed
from orchestrator.model import Cause
from orchestrator.model.cause import plain, said
from orchestrator.service.chosen import Chosen, choose, is_plain, unknown
from orchestrator.service.client import MAX_REQUEST
from orchestrator.service.started import not_charging, with_hint
from orchestrator.service.terms import START_WITH, is_target
from orchestrator.service.where import find_socket
from orchestrator.show import is_alarming, own_language, stands_by, strays, what_to_do
from orchestrator.text.catalogue import say
from orchestrator.text.document import in_language, language_of_answer, refusals
from orchestrator.text.document import said as in_own

#: The requests that are complete only once the charger is verified in standby, and how long to wait for that: a
#: disobedient charger is uncontrollable after 3 s.
STOPS = ("stop", "pause")
STANDBY_S, LOOK_S = 4.0, 0.1
#: The causes of names that no bay has.
UNKNOWN = ("bay_unknown", "bays_unknown")


def request(arguments: argparse.Namespace) -> int:
    """Ask, and say what came of it; 1 if anything was refused, unknown or not verified."""
    port, verb = getattr(arguments, "port", None), arguments.verb
    _check_use(arguments, port)
    path = find_socket(arguments.socket)
    answers = _asked(arguments, port, path)
    results, missing, language = answers.results, answers.missing, answers.language
    accepted = [bay for bay, refusal in results.items() if not refusal]
    unverified: dict[str, str] = {}
    if verb in STOPS:
        # A stop may be carried out and still be answered with a problem, e.g. not persisted: watch its charger as well.
        looked_at = list(results) if verb == "stop" else accepted
        unverified = _wait_for_standby(path, looked_at, language, every=arguments.all)
    refused = [
        with_hint(Cause.of("bay_refused", bay=bay, why=refusal), answers.causes.get(bay) if verb == "start" else None)
        for bay, refusal in results.items()
        if refusal
    ]
    for line in (*unverified.values(), *(say(one, language) for one in refused + missing)):
        print(line, file=sys.stderr, flush=True)  # what to do, before anything else
    for bay in accepted:
        verified = verb in STOPS and bay not in unverified
        done = Cause.of("accepted_verified" if verified else "accepted", bay=bay, verb=verb)
        print(say(done if answers.then is None else done.with_(then=answers.then), language), flush=True)
    for line in not_charging(path, accepted, language) if verb == "start" and answers.then is None else ():
        print(line)
    return 1 if unverified or missing or any(results.values()) else 0


def _check_use(arguments: argparse.Namespace, port: str | None) -> None:
    given = bool(arguments.bay) + arguments.all + (port is not None)
    if given != 1:
        raise UsageError(
            f"{arguments.verb}: name bays, or --all{', or --port' if arguments.verb == 'reset' else ''}"
            f"{', not more than one of these' if given else ''}"
        )
    if port is not None and arguments.excepted:
        raise UsageError("reset: --except goes with bays or --all, not with --port")
    if (target := getattr(arguments, "to", None)) is not None and not is_target(target):
        raise UsageError(f"start: --to {target:g}: it is a SOC in percent, above 0 and at most 100")


@dataclass(slots=True)
class _Answers:
    """Each bay's answer, "" meaning yes; what was asked in vain; and the language to say it in."""

    language: str
    results: dict[str, str] = field(default_factory=dict)
    missing: list[Cause] = field(default_factory=list)
    causes: dict[str, object] = field(default_factory=dict)  #: of the refusals
    then: Cause | None = None  #: when an accepted start comes, if not now

    def take(self, answer: Mapping[str, object]) -> None:
        self.language = language_of_answer(answer, self.language)
        self.causes |= cast("Mapping[str, object]", answer.get("causes", {}))
        told, strangers = refusals(answer, self.language), _strangers(answer)
        self.missing += [said(told[name]) for name in strangers]
        self.results |= {name: why for name, why in told.items() if name not in strangers}
        if isinstance(then := answer.get("then"), Mapping):
            self.then = said(in_own(then, str(then.get("text", "")), self.language))


def _asked(arguments: argparse.Namespace, port: str | None, path: Path) -> _Answers:
    """Ask the service, in as many requests as the names need."""
    verb, answers = arguments.verb, _Answers(own_language())
    words = None if arguments.all else arguments.bay
    base = signed({"verb": verb, **_spares(arguments), **_terms(arguments)}, arguments.because)
    if port is not None:
        answers.take(ask(path, {**base, "bays": None, "port": os.path.abspath(port)}))  # noqa: PTH100 - not resolved
        return answers
    if not arguments.excepted and is_plain(words or ()) and len(list(_parts(words or (), base))) <= 1:
        try:
            answers.take(ask(path, {**base, "bays": words}))
            return answers
        except ServiceError as error:
            if verb != "stop" or not _is_unknown(error.told):
                raise  # else a service not restarted since an update leaves all of it undone
    document = ask(path, {"verb": "status"})
    answers.language = language_of_answer(document, answers.language)
    known = [str(bay["name"]) for bay in cast("list[dict[str, object]]", document["bays"])]
    chosen = choose(words, arguments.excepted, known)
    answers.missing += _missing(chosen, known, verb, answers.language)
    failed: ServiceError | None = None
    for part in _parts(chosen.bays, base):
        try:
            answers.take(ask(path, {**base, "bays": part}))
        except ServiceError as error:
            if verb != "stop":
                raise
            failed = error  # said once the other parts have been tried
    if failed:
        raise failed
    return answers


def _spares(arguments: argparse.Namespace) -> dict[str, bool]:
    """Whoever names a bay means it. `--all`, or a pattern, is not meant for bays that somebody else holds."""
    named = not arguments.all and is_plain(arguments.bay)
    return {"spares": True} if arguments.verb == "start" and not named and not arguments.force else {}


def _terms(arguments: argparse.Namespace) -> dict[str, object]:
    """To which SOC, and when; any other start keeps the verb that every service knows."""
    found = {name: value for name in ("to", "at") if (value := getattr(arguments, name, None)) is not None}
    return {"verb": START_WITH, **found} if found else {}


def _strangers(answer: Mapping[str, object]) -> list[str]:
    """What the service itself answers of names that it does not know."""
    causes = cast("Mapping[str, object]", answer.get("causes", {}))
    return [name for name, cause in causes.items() if _is_unknown(cause)]


def _is_unknown(cause: object) -> bool:
    return isinstance(cause, Mapping) and cause.get("id") in UNKNOWN


def _missing(chosen: Chosen, known: Sequence[str], verb: str, language: str) -> list[Cause]:
    """What the words do not match. ServiceError if nothing is to be done then; a stop is never left undone for that."""
    if not chosen.unknown and chosen.bays:
        return []
    cause = unknown(chosen.unknown, known) if chosen.unknown else Cause("no_bay_left")
    if verb == "stop" and chosen.bays:
        return [cause]
    cause = cause.with_(then=Cause.of("done_nowhere", verb=verb))
    raise ServiceError(say(cause, language), plain(cause))


def _parts(names: Sequence[str], base: Mapping[str, object]) -> Iterator[list[str]]:
    """The names in lists that each fit into one request with the rest of it."""
    part: list[str] = []
    for name in names:
        if part and len(json.dumps({**base, "bays": [*part, name]})) >= MAX_REQUEST:
            yield part
            part = []
        part.append(name)
    if part:
        yield part


def _wait_for_standby(path: Path, names: Sequence[str], language: str, *, every: bool) -> dict[str, str]:
    """Watch these bays until their chargers are in standby; returns what to do about each that is not in time.

    `every`: also watch chargers without a bay.
    """
    end_s = time.monotonic() + STANDBY_S
    while True:
        try:
            document = in_language(ask(path, {"verb": "status"}, max(end_s - time.monotonic(), LOOK_S)), language)
        except ServiceError as error:
            unseen = {name: Cause.of("not_seen_to_stop", bay=name, error=str(error)) for name in names}
            return {name: say(cause, language) for name, cause in unseen.items()}
        found = cast("list[dict[str, object]]", document["bays"])
        bays = [bay for bay in found if bay["name"] in names and not stands_by(bay)]
        others = strays(document, language) if every else []
        if time.monotonic() >= end_s or (all(map(is_alarming, bays)) and not others):
            return {str(bay["name"]): what_to_do(bay, language) for bay in bays} | {text: text for text in others}
        time.sleep(LOOK_S)
