"""A diagram as SVG or PNG, drawn by Graphviz."""

from pygraphviz import AGraph  # type: ignore[import-untyped]  # it has no annotations

from orchestrator.workbench.draw.diagram import Diagram

FORMATS = ("svg", "png")
STYLE = {"fontname": "Helvetica", "fontsize": "11"}


def draw(of: Diagram, form: str) -> bytes:
    """The picture in one of FORMATS."""
    graph = AGraph(directed=True, compound=True, rankdir="TB", nodesep=0.5, ranksep=0.7, newrank=True, **STYLE)
    graph.node_attr.update(shape="box", style="rounded,filled", fillcolor="white", **STYLE)
    graph.edge_attr.update(**STYLE)
    graph.add_node("begin", shape="point", width=0.15)
    for group in of.groups:
        graph.add_nodes_from(group.states)
        heading = "\n".join((", ".join(group.lines[:1]), ", ".join(group.lines[1:]))).strip()
        graph.add_subgraph(
            group.states, f"cluster_{group.name}", label=heading, style="rounded,filled", fillcolor="#eef1f8", **STYLE
        )
    graph.add_nodes_from(of.single)
    graph.add_edge("begin", of.initial)
    inside = {group.name: group.states[0] for group in of.groups}
    for arrow in of.arrows:
        ends = {"ltail": arrow.source, "lhead": arrow.dest}
        graph.add_edge(
            inside.get(arrow.source, arrow.source),
            inside.get(arrow.dest, arrow.dest),
            key=f"{arrow.source} {arrow.dest}",
            label="\n".join(arrow.lines),
            **{end: f"cluster_{name}" for end, name in ends.items() if name in inside},
        )
    picture = graph.draw(format=form, prog="dot")
    assert isinstance(picture, bytes)  # None only if a file was named
    return picture
