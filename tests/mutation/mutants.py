"""A mutant, read from mutmut's files and its `show`."""

import re
from dataclasses import dataclass, replace
from typing import Self

#: mutmut's exit codes: 1 and 3 are pytest's, the others mean that CPU time or time ran out.
KILLED = (1, 3)
TIMED_OUT = (-24, 24, 36, 152, 255)
#: The tests of a trial, in mutmut's environment: of those that run the changed statement the likeliest few, or all.
TESTS, FEW, ALL = "MUTATION_TESTS", "few", "all"


@dataclass(frozen=True)
class Mutant:
    """One small change of one function, and its result."""

    module: str  #: "orchestrator/protocol/frame.py"
    name: str  #: mutmut's name; the numbers change with the function
    exit_code: int | None  #: None if not tried yet
    seconds: float
    was: str = ""
    became: str = ""

    @property
    def tried(self) -> bool:
        """Its tests, if any, have been run."""
        return self.exit_code is not None

    @property
    def killed(self) -> bool:
        """A test failed."""
        return self.exit_code in KILLED

    @property
    def timed_out(self) -> bool:
        """The tests did not end, which a person would notice too."""
        return self.exit_code in TIMED_OUT

    @property
    def lives(self) -> bool:
        """No test noticed or reaches it."""
        return self.tried and not self.killed and not self.timed_out

    @property
    def function(self) -> str:
        """ "FrameDecoder._hunt"."""
        mangled = self.name.rpartition(".")[2].rpartition("__mutmut_")[0]
        return re.sub("^x_?", "", mangled).strip("ǁ").replace("ǁ", ".")

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Its identity across runs."""
        return self.module, self.function, self.was, self.became

    def shown(self, diff: str) -> Self:
        """With its changed lines, from a unified diff."""
        lines = [line for line in diff.splitlines() if line[:1] in ("-", "+") and line[:3] not in ("---", "+++")]
        was, became = (" ".join(line[1:].strip() for line in lines if line[0] == sign) for sign in "-+")
        return replace(self, was=was, became=became)
