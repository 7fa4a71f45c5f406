"""The product's source files, for tests that read them."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PACKAGE = "orchestrator"
ROOT = Path(__file__).resolve().parent.parent / PACKAGE


@dataclass(frozen=True)
class Module:
    """One source file; `name` is dotted and without the package: "core.decide"."""

    name: str
    source: str
    is_package: bool = False

    @property
    def part(self) -> str:
        return self.name.partition(".")[0]

    def nodes(self) -> Iterator[ast.AST]:
        return ast.walk(ast.parse(self.source, self.name))

    def imports(self) -> Iterator[tuple[int, str]]:
        """Line and dotted name of every import; `from a import b` is "a.b"."""
        for node in self.nodes():
            if isinstance(node, ast.Import):
                yield from ((node.lineno, alias.name) for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                origin = ".".join(filter(None, (*self._above(node.level), node.module)))
                yield from ((node.lineno, f"{origin}.{alias.name}") for alias in node.names)

    def _above(self, level: int) -> tuple[str, ...]:
        """The package a relative import of this level starts from."""
        if not level:
            return ()
        path = (PACKAGE, *filter(None, self.name.split(".")))
        return path[: len(path) - level + self.is_package]


def product() -> Iterator[Module]:
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        is_package = parts[-1] == "__init__"
        yield Module(".".join(parts[:-1] if is_package else parts), path.read_text(encoding="utf-8"), is_package)
