"""The shape of the package, checked on the source alone: one meaning per public name, no import circle, few floors,
short files, short functions, short lines (docs/architecture.md, CONTRIBUTING.md).
"""

import ast
from collections import defaultdict
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "biodance"
FLOORS = 8
LINE = 120
LINES = 300
COMPLEXITY = 20  # the end of radon's grade C
ONE_ALGORITHM = {
    "lab/program_tables.py": "tables of OpenSim and BIDS, and what their tools want beside them",
    "pipeline/front.py": "what is asked of a visit: register, identify, diagnose, compare",
    "batch/run.py": "an archive: what is to do, by whom, and what is done",
    "batch/work.py": "one session in its own process, and its outcome",
    "body/human/measures.py": "what a subject measures: the posture of the static trial, typed sizes, the markers' own",
    "body/human/human.py": "the human Body and the prior of its masses",
    "body/human/skeleton.py": "the joint tree of a person, with the joints that only some sessions show",
    "body/parts.py": "what a Body is made of, and lumps of mass as ten parameters about a joint",
    "lab/readers/table.py": "a table's columns to markers and plates: what they hold, units, time, axes",
    "lab/readers/_table_plates.py": "the loads of a table to plates: units, about which point, place",
    "lab/plates/faults.py": "what can be wrong with an installed plate, and recordings without what was accepted",
    "lab/c3d/subject.py": "the subject in a C3D file: points, measures, and what other programs left of it",
    "cycles/cut.py": "a trial cut into what repeats: events, gait cycles, squats, rises, jumps",
    "cycles/__init__.py": "what moved in a trial: events, cycles, curves, and beside what the file says",
    "cycles/summary.py": "from the curves of cycles to the key values of both sides over a session",
    "lab/session/entries.py": "the small tables of session.toml, checked, and what they do to trials",
    "lab/session/recordings.py": "which files of a folder are trials, and what lies beside them",
    "motion/ik/functional_joints.py": "what movement tells of joints: where they are, and which are needed",
    "motion/ik/inverse_kinematics.py": "the postures nearest to markers: guesses, descent, what they determine",
    "motion/kinematics.py": "where a body is: poses, derivatives, coordinates that change smoothly",
    "motion/ik/joint_fit.py": "the fit behind a functional calibration, and what it contradicts",
    "motion/newton.py": "a person as one mass: at rest on the plates, and moving",
    "pipeline/accepted.py": "copies of a session without faults, and what each of them gains",
    "pipeline/attention.py": "what a person must see first: headline, rows, order",
    "dance/playback.py": "a dance played in MuJoCo: torques of the plan, the body that is driven, what became of it",
    "pipeline/dance.py": "a dance from a person to its file's numbers, and what came of it",
    "pipeline/export.py": "a session, a trial or a body in the formats of others",
    "pipeline/front_dance.py": "what is conducted before a visit: dances, simulated laboratories",
    "pipeline/identification.py": "a session's masses, stage by stage, and the quality of each",
    "pipeline/robot.py": "a robot from recording to masses, with what is said of it",
    "pipeline/visits.py": "visits beside each other: their quantities, and what changed",
    "records/session.py": "who came, and what was recorded of him, checked at birth",
    "records/wrench.py": "what was measured: where it came from, markers, plates, the wrench of all of them",
    "virtual_lab/causes.py": "every cause that can be hidden, and the forces among them",
    "virtual_lab/movement/posing.py": "postures to curves, and these to the configuration, standing or seated",
    "virtual_lab/movement/performance.py": "a plan performed, by pinocchio's dynamics, or copied from a screen",
    "virtual_lab/person/__init__.py": "the true body, its habits and loads, its prosthesis; in 12 segments",
    "virtual_lab/visit.py": "a laboratory, and a day in it",
    "effects/_base/effect.py": "the contract of a cause that is fitted, in a channel, or coming and going",
    "effects/_base/exchanged_labels.py": "which markers carry each other's names, and from which frame to which",
    "lab/plates/__init__.py": "what a file and session.toml say of a plate, entry by entry",
    "lab/plates/decode.py": "a plate: its outline, and from channels to wrench: origin, gaps, units, zero, wrench",
    "lab/plates/read.py": "all plates of a recording: decoded, without what is no measurement, placed as told",
    "inference/decision.py": "what a session ends with: places, sizes, habits, reasons, from one posterior",
    "pipeline/live.py": "a recording as a stream: every frame tracked, the wrench watched, the body identified",
    "report/laboratory.py": "a laboratory over all its sessions: its plates, and what it learned",
    "app/window.py": "what a window asks, and what a run has left to answer with",
    "app/sessions.py": "the sessions of a window: their session.toml, state by state, and their runs",
    "cli/dance.py": "the commands before a visit, of a dance, a person or a robot",
    "cli/session.py": "the commands on a session, of a person or a robot, and what they share",
    "diagnosis/robot.py": "what is not as a robot was drawn: a column each, the clearest taken out, and again",
    "dance/dance.py": "a dance and its file, entry by entry: what is written, and what is believed of a stranger's",
    "dance/limits/__init__.py": "what a limit is, and what it judges: planned samples, a motion, an imprecise copy",
    "dance/expectation.py": "what a movement tells of a body, chosen, planned or danced: information, added up",
    "dance/performers.py": "imprecise people: how they err in a dance, and what that leaves of every limit",
    "dance/problem/plan.py": "what a dance is asked to be, key by key of its file",
    "dance/problem/person.py": "what a person's file says, entry by entry, to the body and the plan that are left",
    "dance/search/known_postures.py": "words of limbs, what a person can do of them, and the postures that they make",
    "dance/search/move.py": "a move within all limits: straight, slower, round about, exciting; each tries the next",
    "dance/search/postures.py": "the search for exciting postures: one, its image, sweeps over all, exchange",
    "dance/search/word_course.py": "the search from posture to posture of words: reach, choice, going back, refusal",
    "inference/sets.py": "the search over sets of causes: score, fit, widen, lessen, again beside an unknown",
    "lab/plates/sense.py": "the directions of a plate: every hypothesis is judged by the same load on the same plate",
    "registration/__init__.py": "what is concluded of a pose, and the session that is written with it",
    "lab/inspect.py": "what a recording and a session hold, for a person and as the first session.toml",
    "motion/ik/compiled/legs.py": "the legs of a person in closed form, and any of six joints by Newton",
    "body/tables/anthropometry.py": "tables with provenance, and among them those of segments, row by row",
    "report/figures/vector.py": "a light figure: axis, steps, marks, panel, curves; every mark is read by one script",
    "virtual_lab/recording_faults.py": "faults of a recording: three builders and what each of them makes",
    "virtual_lab/movement/gait.py": "one stride on a belt: feet, forces, and the motion that they make, by repetition",
    "body/body.py": "the Body record, its Pinocchio model and its file: one list of fields",
    "body/human/opinions.py": "what tape and scan say of the segments beside the table",
    "body/human/scaling.py": "from static markers to the whole body, the parts without markers included",
    "body/human/scan.py": "a closed surface, cut at the joints into segments",
    "body/urdf_file.py": "what a URDF file says of links, joints and soles",
    "body/tables/choice.py": "every published table evaluated for one subject, chosen by its name",
    "lab/c3d/raw.py": "the bytes of a C3D file to points and analog values in known units",
    "lab/markers/guess.py": "one assignment of labels to landmarks, by name, side, height and neighbours",
    "lab/markers/names.py": "the spellings of a label and what they mean",
    "lab/markers/sets.py": "marker sets: their files, and which one a recording wears",
    "lab/markers/signals.py": "markers that do what no body does, and the gaps that they leave",
    "lab/markers/upright.py": "who stands in a cloud of points: quiet frames, axis to the head, person",
    "lab/readers/trc.py": "a .trc file, read and written, with the forces beside it",
    "lab/session/file.py": "session.toml, key by key",
    "lab/session/results_folder.py": "a folder of results that is there whole or not at all, with its manifest",
    "motion/contact.py": "which frames are fully measured, and why the others are not",
    "motion/grounded.py": "a robot's joint angles to its motion on the ground, and the plate beside it",
    "motion/ik/compiled/newton.py": "the marker cost of a frame with its derivatives, and its minimum",
    "motion/soles.py": "where the soles are, over which surface and plate",
    "motion/track.py": "markers to a smooth motion: states of angles, cut-off, derivatives",
    "identification/loads.py": "what the table leaves open: loads, the trunk's matter, sides, a prosthesis, devices",
    "identification/mismatch.py": "what disturbs a session, and its data less that: scores, sizes, dilution",
    "identification/validation.py": "kept trials beside what fitted ones tell of their plates, and how sure a gain is",
    "pipeline/trial.py": "one trial through all its steps, and its records",
    "identification/added_mass.py": "a load on one segment: its posterior, its place, the smallest to be found",
    "pipeline/learn.py": "a laboratory over all its sessions: its plates, its tolerances, its healthy people",
    "pipeline/movement.py": "what moved in a visit, and what of it the person measured is told",
    "pipeline/still.py": "what is drawn of a body, an instant or a whole session",
    "report/write.py": "what is written of a session, and the paragraph on its methods",
    "report/figures/session.py": "what is drawn of a session's trials and of their repetitions",
    "report/tables/session.py": "a session's results, declared once, as a document and as tables",
    "uncertainty/session_noise.py": "the noise of cameras, plates and skin, by what a session itself shows",
    "uncertainty/sources.py": "every elementary error of a person, forward and transpose",
    "settings.py": "every choice with its unit, range and meaning",
}
"""Files of up to 500 lines, each one algorithm that nobody can follow once it is cut: cut at 300 lines, the way of a
plate's samples returned 40 times to a file that it had left.
"""
CONTRACTS = {
    "biodance.effects": {"EFFECT"},
    "biodance.dance.limits": {"LIMIT"},
    "biodance.lab.readers": {"NAME", "EXTENSIONS", "PREFERENCE", "FOLLOWS_TOLD", "sniff", "read"},
    "biodance.body.export": {"FORMAT", "SUFFIX", "text", "data", "beside"},
    "biodance.observations": {"OBSERVER"},
}
"""Family -> the names that every member gives because its contract asks for them."""
FAMILIES = {
    *CONTRACTS,
    "biodance.body.tables.anthropometry",
    "biodance.lab.markers.sets",
    "biodance.report.pages.language",
}
"""Where a family is found: each has its `FAMILY` (`biodance/discovery.py`)."""

Graph = Mapping[str, set[str]]


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def modules() -> dict[str, ast.Module]:
    """Every module of the package by its full name."""
    return {module_name(path): ast.parse(path.read_text()) for path in sorted(PACKAGE.rglob("*.py"))}


@cache
def walked(tree: ast.AST) -> tuple[ast.AST, ...]:
    """All nodes of a module or of a part of it."""
    return tuple(ast.walk(tree))


def public_names(tree: ast.Module) -> set[str]:
    """Functions, classes and constants without underscore that a module defines itself."""
    found = set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}
    return {name for name in found if not name.startswith("_")}


def homonyms(trees: Mapping[str, ast.Module], contracts: Mapping[str, set[str]]) -> dict[str, list[str]]:
    """Public names with more than one home; those of a family's contract are left out in its members."""
    homes = defaultdict(list)
    for module, tree in trees.items():
        for name in public_names(tree) - contracts.get(module.rpartition(".")[0], set()):
            homes[name].append(module)
    return {name: found for name, found in sorted(homes.items()) if len(found) > 1}


def imports(trees: Mapping[str, ast.Module]) -> dict[str, set[str]]:
    """Module -> modules of the package that it imports anywhere: in functions and for types, too."""
    graph: dict[str, set[str]] = {}
    for module, tree in trees.items():
        wanted: set[str] = set()
        for node in walked(tree):
            if isinstance(node, ast.Import):
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                inner = {f"{node.module}.{alias.name}": node.module for alias in node.names}
                wanted |= {full if full in trees else outer for full, outer in inner.items()}
        graph[module] = {other for other in wanted if other in trees and other != module}
    return graph


def circles(graph: Graph) -> list[list[str]]:
    """Groups of modules that import each other (Tarjan's strongly connected components)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found = []

    def visit(one: str) -> None:
        index[one] = low[one] = len(index)
        stack.append(one)
        for other in sorted(graph[one]):
            if other not in index:
                visit(other)
            if other in stack:
                low[one] = min(low[one], low[other])
        if low[one] == index[one]:
            group = stack[stack.index(one) :]
            del stack[stack.index(one) :]
            if len(group) > 1:
                found.append(sorted(group))

    for module in graph:
        if module not in index:
            visit(module)
    return found


def floors(graph: Graph, folder: str) -> int:
    """The longest chain of imports between the files of a folder, a sub-folder counted as one; what imports in a circle
    counts as often as it has members.
    """
    room = folder + "."

    def node(module: str) -> str:
        return module if module == folder else room + module.removeprefix(room).split(".")[0]

    inside: dict[str, set[str]] = defaultdict(set)
    for module, others in graph.items():
        if module == folder or module.startswith(room):
            here = node(module)
            inside[here] |= {node(o) for o in others if o == folder or o.startswith(room)} - {here}
    group = {one: {one} for one in inside}
    for circle in circles(inside):
        group |= {one: set(circle) for one in circle}

    @cache
    def height(members: frozenset[str]) -> int:
        below = {frozenset(group[other]) for one in members for other in inside[one]} - {members}
        return len(members) + max(map(height, below), default=0)

    return max((height(frozenset(group[one])) for one in inside), default=0)


def folders(trees: Iterable[str]) -> list[str]:
    """Every folder inside the package that holds modules."""
    return sorted({module.rpartition(".")[0] for module in trees} - {"", "biodance"})


def bodies(tree: ast.Module) -> list[tuple[str, int]]:
    """Name and length in lines of every function's body, its docstring not counted."""
    found = []
    for node in walked(tree):
        if isinstance(node, ast.FunctionDef):
            lines = node.body[1:] if ast.get_docstring(node) is not None else node.body
            found.append((node.name, lines[-1].end_lineno - lines[0].lineno + 1 if lines else 0))
    return found


DECISIONS = (ast.If, ast.IfExp, ast.For, ast.While, ast.ExceptHandler, ast.comprehension, ast.Assert)


def complexity(function: ast.FunctionDef) -> int:
    """McCabe's number as radon counts it: one more than the decisions, those inside expressions included, which ruff's
    C901 leaves out; a function inside counts for itself.
    """
    inside = [node for node in walked(function) if isinstance(node, ast.FunctionDef) and node is not function]
    nodes = set(walked(function)).difference(*map(walked, inside))
    joined = sum(len(node.values) - 1 for node in nodes if isinstance(node, ast.BoolOp))
    filtered = sum(len(node.ifs) for node in nodes if isinstance(node, ast.comprehension))
    last = sum(bool(node.orelse) for node in nodes if isinstance(node, ast.For | ast.While | ast.Try))
    return 1 + sum(isinstance(node, DECISIONS) for node in nodes) + joined + filtered + last


@cache
def graph_of_the_package() -> Graph:
    return imports(modules())


def test_a_public_name_has_one_meaning() -> None:
    found = homonyms(modules(), CONTRACTS)
    assert set(found.pop("FAMILY")) == FAMILIES
    assert found == {}, "One meaning per public name: rename one, share it, or make it private."


def test_nothing_is_imported_in_a_circle() -> None:
    """The front door names what lives inside for type checkers only; nothing inside imports it."""
    assert circles(graph_of_the_package()) == []


def test_a_folder_has_few_floors() -> None:
    graph = graph_of_the_package()
    high = {folder: count for folder in folders(graph) if (count := floors(graph, folder)) > FLOORS}
    assert high == {}, f"More than {FLOORS} floors: cut the folder into folders, or the chain of imports shorter."


def test_files_and_functions_are_short() -> None:
    lengths = {
        path.relative_to(PACKAGE).as_posix(): len(path.read_text().splitlines()) for path in PACKAGE.rglob("*.py")
    }
    assert sorted(path for path, count in lengths.items() if count > LINES) == sorted(ONE_ALGORITHM)
    assert max(lengths[path] for path in ONE_ALGORITHM) <= 500
    functions = [(count, f"{module}.{name}") for module, tree in modules().items() for name, count in bodies(tree)]
    assert [one for one in functions if one[0] > 70] == []
    over = sorted(one for one in functions if one[0] > 40)
    assert len(over) <= 0.05 * len(functions), f"functions with more than 40 lines: {over}"


def test_a_function_takes_few_decisions() -> None:
    functions = [
        (complexity(node), f"{module}.{node.name}")
        for module, tree in modules().items()
        for node in walked(tree)
        if isinstance(node, ast.FunctionDef)
    ]
    over = [one for one in functions if one[0] > COMPLEXITY]
    assert over == [], "Find the decision in it and give it a name."


def test_no_line_is_long() -> None:
    code = [
        path
        for place in ("biodance", "tests", "benchmarks", "examples", "anthropometry", "protocols", "docs")
        for kind in ("py", "toml", "j2")
        for path in (ROOT / place).rglob(f"*.{kind}")
    ]
    long = [
        f"{path.relative_to(ROOT)}:{number}"
        for path in (*code, *ROOT.glob("*.toml"))
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        if len(line) > LINE
    ]
    assert long == []


GROWING = {
    "biodance.app.sessions": {"SessionRun"},
    "biodance.dance.search.word_course": {"WordSearch", "_Place"},
    "biodance.diagnosis.watch": {"MarkerWatch", "WrenchWatch"},
}
"""Dataclasses that are filled while somebody works, by module; every other one is a record that nobody changes."""


def test_records_are_frozen() -> None:
    found: dict[str, set[str]] = defaultdict(set)
    for module, tree in modules().items():
        for node in walked(tree):
            if isinstance(node, ast.ClassDef):
                made = [ast.unparse(one) for one in node.decorator_list if "dataclass" in ast.unparse(one)]
                if any("frozen=True" not in one for one in made):
                    found[module].add(node.name)
    assert found == GROWING


TINY = {
    "package.a": "from package.b import two\n\none = 1\n",
    "package.b": "two = 2\n\n\ndef f():\n    from package.room.c import one\n",
    "package.room.c": "import package.a\n\none = 3\nNAME: str = 'c'\n",
    "package.room.d": "from package.room import c\n\nNAME = 'd'\n_hidden = 1\n",
}


@pytest.fixture
def tiny() -> dict[str, ast.Module]:
    return {name: ast.parse(text) for name, text in TINY.items()}


def test_the_checks_see_what_is_wrong(tiny: dict[str, ast.Module]) -> None:
    assert homonyms(tiny, {"package.room": {"NAME"}}) == {"one": ["package.a", "package.room.c"]}
    assert set(homonyms(tiny, {})) == {"NAME", "one"}
    graph = imports(tiny)
    assert circles(graph) == [["package.a", "package.b", "package.room.c"]]
    assert floors(graph, "package.room") == 2
    assert floors(graph, "package") == 3  # a, b and the folder room, in a circle
    assert floors({"h.a": {"h.b.x"}, "h.b.x": {"h.b.y"}, "h.b.y": set(), "h.c": {"h.a"}}, "h") == 3
    assert bodies(ast.parse('def f():\n    """Doc."""\n    a = 1\n    return a\n')) == [("f", 2)]


NAMED_ELSEWHERE = {
    "biodance.lab.plates.faults": "the six faults whose formulas corrections and tolerances need below `effects`",
    "biodance.lab.plates.read": "the reader's two defects, named as the causes that tell them (`Defect.effect`)",
    "biodance.body.human.human": "joint_centre, a row of the table of error sizes",
    "biodance.body.human.static_centres": "joint_centre, a row of the table of error sizes",
    "biodance.body.tables.choice": "trunk_joint, the body's optional joint",
    "biodance.motion.ik.joint_fit": "marker_misplaced, a row of the table of error sizes",
    "biodance.body.tables.anthropometry": "body_mass, a key of the tables of segments",
    "biodance.uncertainty.caution": "joint_centre, a row of the table of error sizes",
    "biodance.uncertainty.sources": "joint_centre, a row of the table of error sizes",
    "biodance.uncertainty.tolerances": "joint_centre, a row of the table of error sizes",
    "biodance.uncertainty.visits": "joint_centre, a row of the table of error sizes",
    "biodance.report.tables.identification": "added_mass, a key of the documents that programs read",
    "biodance.report.tables.session": "added_mass, a key of the documents that programs read",
}
"""Modules that write a word that is an effect's name, too, and why: below `effects`, or another thing of that name."""
APART = ("biodance.effects", "biodance.virtual_lab")
"""Rooms that name effects: their own, and the one that makes faults without their formulas."""


SEEN = "biodance.observations."
"""Each witness says in its own file which effects it is for, as ``Member.name``: a fact of the witness."""


def effect_names() -> set[str]:
    return {path.stem for path in (PACKAGE / "effects").glob("*.py") if path.stem != "__init__"}


def naming_effects(trees: Mapping[str, ast.Module], names: set[str]) -> set[str]:
    """Modules with a string that is the name of an effect, docstrings not counted."""
    return {
        module
        for module, tree in trees.items()
        for node in walked(tree)
        if isinstance(node, ast.Constant) and node.value in names
    }


def keyed_by_effects(trees: Mapping[str, ast.Module], names: set[str], members: set[str]) -> list[str]:
    """Tables whose keys or items are two effects or more, by their names or as ``Member.name``."""

    def is_effect(node: ast.expr | None) -> bool:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            return node.attr == "name" and node.value.id in members
        if isinstance(node, ast.Tuple):
            return bool(node.elts) and is_effect(node.elts[0])
        return isinstance(node, ast.Constant) and node.value in names

    found = []
    for module, tree in trees.items():
        for node in walked(tree):
            items = node.keys if isinstance(node, ast.Dict) else getattr(node, "elts", [])
            if sum(map(is_effect, items)) > 1:
                found.append(f"{module}:{node.lineno}")
    return found


def outside(trees: Mapping[str, ast.Module]) -> dict[str, ast.Module]:
    return {module: tree for module, tree in trees.items() if not module.startswith(APART)}


def test_what_is_known_of_an_effect_stands_in_its_own_file() -> None:
    """A table by effect is a second place that knows of them, and an effect from outside is in none of them."""
    assert naming_effects(outside(modules()), effect_names()) == set(NAMED_ELSEWHERE)
    members = {"".join(map(str.capitalize, name.split("_"))) for name in effect_names()}
    assert [one for one in keyed_by_effects(outside(modules()), effect_names(), members) if SEEN not in one] == []


def test_a_table_by_effect_is_seen() -> None:
    tables = (
        "A = {'tilt': 1, 'hum': 2}",
        "A = ('tilt', 'hum')",
        "A = {Tilt.name, Hum.name}",
        "A = {('tilt', 'm'): 1, ('hum', 's'): 2}",
    )
    one = ("A = {'tilt': 1}", "A = ('tilt', 'place')")
    for text in (*tables, *one):
        trees = {"package.a": ast.parse(text)}
        assert keyed_by_effects(trees, {"tilt", "hum"}, {"Tilt", "Hum"}) == (["package.a:1"] if text in tables else [])
    assert naming_effects({"package.a": ast.parse(one[0])}, {"tilt"}) == {"package.a"}
