"""Lints a policy at the bay that uses it: the policy is in amperes, and the charger has five steps."""

from collections.abc import Iterator, Mapping

from orchestrator.config.amperes import highest_step, max_ah, max_hours, row_a, tables
from orchestrator.config.policy import Band, Policy, Where
from orchestrator.config.rules import Problems
from orchestrator.keys import Source
from orchestrator.model import ControlMode

#: A pack's capacity is about this factor below the most that a charge may take (`finish.max_ah`, as its help advises).
MARGIN = 1.1

Steps = tuple[float, ...]


def bay_lint(values: Mapping[str, object], _written: Source) -> Problems:
    """Warnings about each bay's policy in combination with its charger."""
    for path, policy in values.items():
        bay = path.removesuffix(".policy")
        if not isinstance(policy, Policy) or values.get(f"{bay}.charger.control") is not ControlMode.MANUAL:
            continue
        steps_a, limit_a = values.get(f"{bay}.charger.steps_a"), values.get(f"{bay}.limits.current_a")
        more = values.get(f"{bay}.charger.tolerance_pct")
        if isinstance(steps_a, tuple) and isinstance(limit_a, float) and isinstance(more, float):
            worst_a = tuple(amps * (1 + more / 100) for amps in steps_a)
            yield from ((path, text) for text in _at_bay(policy, tuple(amps for amps in worst_a if amps <= limit_a)))


def _at_bay(policy: Policy, worst_a: Steps) -> Iterator[str]:
    """`worst_a` is the most that may flow on each step that the station allows, lowest first."""
    if not worst_a:
        return
    yield from _refused(policy, worst_a)
    best = min((max(_amps(policy, table.rows)) for _, table in tables(policy.current)), default=policy.pack.current_a)
    step = highest_step(min(best, policy.pack.current_a), worst_a)
    if step is None:
        return
    finish, source = policy.finish, policy.source
    charge_ah, limit_h = max_ah(policy.pack, finish) / MARGIN, max_hours(policy, worst_a)
    hours = charge_ah / worst_a[step]
    if hours > limit_h:
        yield (
            f"{policy.policy} allows at most {worst_a[step]:g} A here: {charge_ah:.0f} Ah take {hours:.1f} h, and "
            f"{limit_h:g} h are a fault ({source.at('finish.max_hours')})"
        )


def _refused(policy: Policy, worst_a: Steps) -> Iterator[str]:
    """Rows that even the lowest step exceeds: there no charge begins, and a running one pauses."""
    source, rule = policy.source, policy.precharge
    if rule is not None and worst_a[0] > rule.max_a:
        yield (
            f"{policy.policy} allows {rule.max_a:g} A in precharge ({source.at('precharge.max_a')}), the lowest step "
            f"here is {worst_a[0]:g} A: deeply discharged packs are refused"
        )
    every: dict[str, Band | Where] = {f"current.where[{n}]": rule for n, rule in enumerate(policy.current.where)}
    for name, table in tables(policy.current):
        every |= {f"current.{name}.rows[{n}]": row for n, row in enumerate(table.rows)}
    for key, row in every.items():
        amps = row_a(row, policy.pack.current_a, policy.pack.capacity_ah)
        if 0 < amps < worst_a[0]:
            yield (
                f"{policy.policy} allows {amps:g} A ({source.at(key)}), the lowest step here is {worst_a[0]:g} A: "
                "there no charge begins, and one that runs pauses"
            )


def _amps(policy: Policy, rows: tuple[Band, ...]) -> list[float]:
    return [row_a(row, policy.pack.current_a, policy.pack.capacity_ah) for row in rows]
