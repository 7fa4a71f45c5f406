"""What holds for all tests, whoever starts them and on however busy a machine.

Signals that the starter has ignored (`nohup`, a job in the background) are heard again: what is ignored stays ignored
in all child processes, and ending a service by a signal is what some tests are about. Generated examples have no
deadline: on a busy machine a slow one says nothing of the code.
"""

import signal

from hypothesis import settings

for number in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.default_int_handler if number is signal.SIGINT else signal.SIG_DFL)

settings.register_profile("all", deadline=None)
settings.load_profile("all")
