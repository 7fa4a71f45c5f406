"""Runs one demo from beginning to end."""

import shutil
import signal
import sys
import time
from contextlib import suppress

from orchestrator.demo.screen import Lines, Picture, Screen
from orchestrator.demo.stage import Stage
from orchestrator.demo.story import SHOWN_BY_A_STOP, SINCE, Story
from orchestrator.errors import OrchestratorError
from orchestrator.sim.faults import FAULTS

#: How often the picture is refreshed.
LOOK_EVERY_S = 0.1
#: Entries for which the service does not stop.
NO_FAULT = ("heal", "frozen_temperature", "soc_jump")


def demo(fault: str | None, *, plain: bool, page: bool = False) -> int:
    """Charge an emulated battery, or stop because of `fault`; 0 if it ended as it should.

    With a `page` it goes on until Ctrl-C: people may do there what they like.
    """
    known = [name for name in FAULTS if name not in NO_FAULT]
    if fault == "list":
        for name in known:
            print(f"{name:22} {FAULTS[name].about}")
        return 0
    if fault is not None and fault not in known:
        raise OrchestratorError(f"no fault {fault!r}: {', '.join(known)}")
    import orchestrator.sim.plant  # noqa: F401 - the plant's process needs an extra; without it, say so now

    screen = _screen(plain=plain)
    story = Story(fault)
    print(
        "An emulated charger on a pseudo-terminal, an emulated BMU on a CAN bus, and the service between them.",
        flush=True,
    )
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # it ends as by Ctrl-C: nothing of it is left running
    with Stage() as stage:
        if page:
            print(f"{stage.serve()} (Ctrl-C ends the demo)", flush=True)
            _watch_on(stage, story, screen)
        else:
            with screen.live():
                _watch(stage, story, screen)
            _sum_up(stage, story)
    if story.well or page:
        shutil.rmtree(stage.directory, ignore_errors=True)
    else:
        print(f"journal and log: {stage.directory}", file=sys.stderr)
    return 0 if story.well or page else 1


def _screen(*, plain: bool) -> Screen:
    if plain or not sys.stdout.isatty():
        return Lines()
    try:
        return Picture()
    except ImportError:
        return Lines()


def _watch_on(stage: Stage, story: Story, screen: Screen) -> None:
    """Watch the bay until Ctrl-C."""
    with suppress(KeyboardInterrupt), screen.live():
        _watch(stage, story, screen, on=True)


def _watch(stage: Stage, story: Story, screen: Screen, *, on: bool = False) -> None:
    """Watch the bay until the story is over, or `on` and on."""
    began_s = time.monotonic()
    while not story.over(t_s := time.monotonic() - began_s) or on:
        bay = stage.bay()
        if bay is not None:
            story.look(t_s, bay)
            if story.inject_now(t_s) and story.fault:
                stage.plant.inject(story.fault)
                story.injected(t_s, FAULTS[story.fault].about)
                if story.fault in SHOWN_BY_A_STOP:
                    stage.stop()
            screen.show(t_s, bay, story)
        time.sleep(LOOK_EVERY_S)


def _sum_up(stage: Stage, story: Story) -> None:
    """Print what happened, and what the emulated charger itself reports at the end."""
    truth = stage.plant.state()
    for session in story.sessions:
        print(
            f"\nCharged {session['charged_ah']:.3f} Ah ({session['charged_wh']:.1f} Wh) "
            f"in {session['energised_s']:.0f} s, SOC {session['soc_start_pct']} → {session['soc_pct']} %, "
            f"{session['step_changes']} changes of the step."
        )
    if story.stopped_by:
        print(f"It stopped because: {story.stopped_by}")
    if story.fault and truth["injected_s"] is not None and truth["first_stop_s"] is not None:
        after_s = truth["first_stop_s"] - truth["injected_s"]
        since = SINCE.get(story.fault, "the fault began")
        print(f"The first stop frame reached the charger {after_s:.3f} s after {since}.")
    print(f"State {story.state}. The emulated charger: operation {truth['operation']}, {truth['current_a']:.2f} A.")
    if not story.well:
        print("This demo did not end as it should.", file=sys.stderr)
