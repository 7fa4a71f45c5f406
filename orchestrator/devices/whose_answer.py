"""Decides whose an SDO answer is: ours, another master's, nobody's, or unclear (FAULTS B27)."""

from orchestrator.devices.other_masters import OtherMasters
from orchestrator.devices.sdo_client import SdoClient, Verdict
from orchestrator.protocol.sdo import SdoMalformed, SdoReply, SdoValue


def whose_answer(reply: SdoReply, data: bytes, client: SdoClient, others: OtherMasters, now_s: float) -> Verdict:
    """The verdict on the reply in `data`. If it is unclear, our request is given up.

    A value is the node's own, whoever asked for it: it is accepted, and as old as the older of both requests. A refusal
    or a confirmation would mislead anybody but its addressee, and a node that aborts another master's longer transfer
    because of our request does not answer ours.
    """
    if not others.active:
        return client.take(reply, now_s)
    if others.in_transfer(data, now_s):
        if not others.transferring:
            client.hurry(now_s)
        return Verdict.FRAGMENT
    if isinstance(reply, SdoMalformed) and others.going:
        return Verdict.FRAGMENT
    if others.breaks_off(reply):
        client.drop()
        return Verdict.UNCLEAR
    theirs = others.owner(reply)
    if theirs is None:
        if not others.out_of_step(reply):
            return client.take(reply, now_s)
        if not client.claims(reply):
            client.hurry(now_s)
            return Verdict.FRAGMENT
        client.drop()
        return Verdict.UNCLEAR
    if not client.claims(reply):
        others.close(theirs)
        return Verdict.THEIRS
    if isinstance(reply, SdoValue):
        client.asked_s = min(client.asked_s, theirs.t_s)
        return client.take(reply, now_s)
    others.close(theirs)
    client.drop()
    return Verdict.UNCLEAR
