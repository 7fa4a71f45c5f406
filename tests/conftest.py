"""Signals that whoever started the tests has ignored (`nohup`, a job in the background) are heard again.

What is ignored stays ignored in all child processes, and ending a service by a signal is what some tests are about.
"""

import signal

for number in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, signal.default_int_handler if number is signal.SIGINT else signal.SIG_DFL)
