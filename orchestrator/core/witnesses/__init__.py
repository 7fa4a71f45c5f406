"""The two witnesses of a charge: what the charger says and what the BMU says, held against each other in every state.

Theory of operation. Either of them may be silent, wrong, frozen, or on another battery, and none of that shows in its
own words. So no word counts alone where the other one can be heard: standby is proved by both (`standby.py`), volts and
amps are compared and each is watched for standing still while the other moves (`measured.py`), the pack's volts a cell
must fit its SOC and its chemistry (`pack.py`), and the first amperes of a charge must show on the bay's own BMU
(`paired.py`). `followed.py` carries what must be followed from step to step. Each sentence names which of the two is
likelier wrong, where anything tells.
"""
