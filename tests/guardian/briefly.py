"""`orchestrator estop` that watches stopped chargers for a fifth of the time: its tests would mostly wait for that."""

#: In place of `-m orchestrator`.
BRIEFLY = (
    "-P",
    "-c",
    "import sys; from orchestrator.lastresort import estop; estop.WATCH_S /= 5; "
    "from orchestrator.__main__ import main; sys.exit(main())",
)
