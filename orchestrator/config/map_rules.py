"""Rules between the keys of one object map."""

from itertools import pairwise

from orchestrator.config.names import name_problem
from orchestrator.config.rules import Problems, Rule
from orchestrator.config.yaml.scalars import did_you_mean
from orchestrator.protocol.objects import READING_FIELDS, ObjectEntry, Sweep, TpdoEntry

SIZES = (1, 2, 4)  #: possible bytes in an expedited SDO answer of this BMU (CANopen manual §3.2)
TPDO_BYTES = 8  #: in one CAN frame
#: What can stop a charge, and the sweeps that read it often enough.
STOPPING = {
    "voltage_v": (Sweep.FAST,),
    "current_a": (Sweep.FAST,),
    "temperature_c": (Sweep.FAST, Sweep.MEDIUM),
    "status": (Sweep.FAST,),
}
#: Without these no charge can be supervised.
REQUIRED = (*STOPPING, "soc_pct", "soh_pct")

Objects = tuple[ObjectEntry, ...]


def _name(name: str) -> Problems:
    if problem := name_problem(name):
        yield "map", problem


def _unique_objects(objects: Objects) -> Problems:
    seen: dict[tuple[int, int], int] = {}
    for i, entry in enumerate(objects):
        first = seen.setdefault((entry.index, entry.sub), i)
        if first != i:
            yield f"objects[{i}].index", f"0x{entry.index:04X} sub {entry.sub} is objects[{first}] already"


def _sizes(objects: Objects) -> Problems:
    for i, entry in enumerate(objects):
        if entry.size not in SIZES:
            yield f"objects[{i}].size", f"{entry.size} bytes cannot be; allowed: 1, 2 or 4"


def _bits(objects: Objects) -> Problems:
    for i, entry in enumerate(objects):
        for j, field in enumerate(entry.fields):
            at = f"objects[{i}].fields[{j}]"
            end = field.first_bit + field.width
            if end > entry.size * 8:
                yield (
                    f"{at}.width",
                    f"bits {field.first_bit} … {end - 1} reach beyond the object's {entry.size} bytes "
                    f"(bits 0 … {entry.size * 8 - 1})",
                )
            if field.unavailable is not None and field.unavailable >= 1 << field.width:
                yield f"{at}.unavailable", f"{field.unavailable:#x} does not fit into {field.width} bits"
            if field.scale == 0:
                yield f"{at}.scale", "0 would make every value the same; what is one raw count?"


def _overlap(objects: Objects) -> Problems:
    for i, entry in enumerate(objects):
        rows = sorted((field.first_bit, j) for j, field in enumerate(entry.fields))
        for (_, lower), (first_bit, upper) in pairwise(rows):
            below = entry.fields[lower]
            if first_bit < below.first_bit + below.width:
                yield (
                    f"objects[{i}].fields[{upper}].first_bit",
                    f"{first_bit} lies inside {below.name}, "
                    f"which has bits {below.first_bit} … {below.first_bit + below.width - 1}",
                )


def _field_names(objects: Objects) -> Problems:
    seen: dict[str, str] = {}
    for i, entry in enumerate(objects):
        for j, field in enumerate(entry.fields):
            at = f"objects[{i}].fields[{j}].name"
            if field.name not in READING_FIELDS:
                yield at, f"no field is called {field.name!r}; {did_you_mean(field.name, READING_FIELDS)}"
            elif field.name in seen:
                yield at, f"{field.name} comes twice: it is {seen[field.name]} already"
            else:
                seen[field.name] = f"objects[{i}].fields[{j}]"


def _required(objects: Objects) -> Problems:
    sweeps = {field.name: (i, entry.sweep) for i, entry in enumerate(objects) for field in entry.fields}
    for name in REQUIRED:
        if name not in sweeps:
            yield "objects", f"no object holds {name}; without it no charge can be supervised"
        elif sweeps[name][1] not in (often := STOPPING.get(name, Sweep)):
            allowed = " or ".join(often)
            yield f"objects[{sweeps[name][0]}].sweep", f"must be {allowed}, because {name} can stop a charge"


def _tpdos(tpdos: tuple[TpdoEntry, ...], objects: Objects) -> Problems:
    sizes = {entry.index: entry.size for entry in objects if entry.sub == 0}
    numbers: set[int] = set()
    for i, tpdo in enumerate(tpdos):
        if tpdo.number in numbers:
            yield f"tpdos[{i}].number", f"TPDO {tpdo.number} comes twice"
        numbers.add(tpdo.number)
        for j, index in enumerate(tpdo.objects):
            if index not in sizes:
                known = ", ".join(f"0x{known:04X}" for known in sizes)
                yield f"tpdos[{i}].objects[{j}]", f"0x{index:04X} is not one of this map's objects: {known}"
        if (total := sum(sizes.get(index, 0) for index in tpdo.objects)) > TPDO_BYTES:
            yield f"tpdos[{i}].objects", f"together {total} bytes; one TPDO carries at most {TPDO_BYTES}"


MAP_RULES: tuple[Rule, ...] = (
    Rule(_name, ("map",)),
    Rule(_unique_objects, ("objects",)),
    Rule(_sizes, ("objects",)),
    Rule(_bits, ("objects",)),
    Rule(_overlap, ("objects",)),
    Rule(_field_names, ("objects",)),
    Rule(_required, ("objects",)),
    Rule(_tpdos, ("tpdos", "objects")),
)
