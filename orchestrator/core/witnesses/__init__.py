"""The two witnesses of a charge: the reports of charger and BMU, compared with each other in every state.

Theory of operation. Either may be silent, wrong, frozen, or on another battery, and none of that shows in its own
report. So no report counts alone while the other witness can be heard. Standby is proved by both (`standby.py`). Volts
and amps are compared, and each is checked for being frozen while the other moves (`measured.py`). The pack's volts per
cell must fit its SOC and its chemistry (`pack.py`), and the first amperes of a charge must show on the bay's own BMU
(`paired.py`). `followed.py` holds the state carried between decisions. Each sentence names the witness that is likelier
wrong, if anything tells.
"""
