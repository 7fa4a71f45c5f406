"""Programs that wait for less time than people's: most of their tests are about something else."""

#: `python … estop PORT`: a stopped charger is watched for a fifth of the time.
ESTOP = (
    "-P",
    "-c",
    "import sys; from orchestrator.lastresort import estop; estop.WATCH_S /= 5; "
    "from orchestrator.__main__ import main; sys.exit(main())",
)
#: `python … run STATION`: the guardian waits a second for the proof of a standby, and watches it for less.
GUARDIAN = (
    "-P",
    "-c",
    "import sys; from orchestrator.lastresort import guardian; guardian.VERIFY_S = 1.0; "
    "from orchestrator.__main__ import main; sys.exit(main())",
)
