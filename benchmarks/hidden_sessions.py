"""Sessions with something hidden in them, cached on disk: simulate -> C3D -> read -> prepare -> scale -> track, each
done once.

Used by bench_diagnosis.py. The cache is a folder (BIODANCE_CACHE, or biodance_diagnosis in the temporary directory);
what is there is not made again, so that a run that was stopped goes on where it stopped.
"""

import copyreg
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from unittest.mock import patch

import numpy as np
from kept_files import kept
from kept_files import store as store
from virtual_visits import subjects

from biodance.body.body import Body
from biodance.body.human.scaling import Scaling
from biodance.lab.session.read import read_session
from biodance.motion.track import track
from biodance.pipeline.body import calibrate_joints
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine
from biodance.pipeline.trial import Prepared
from biodance.records import Motion, Trial
from biodance.virtual_lab.faults.causes import hide, parse_cause
from biodance.virtual_lab.movement.performance import Performance, perform
from biodance.virtual_lab.movement.protocol import TrialPlan, read_protocol
from biodance.virtual_lab.person.person import Person
from biodance.virtual_lab.recording.laboratory import LabVisit
from biodance.virtual_lab.simulate import simulate_session

CACHE = Path(os.environ.get("BIODANCE_CACHE", tempfile.gettempdir())) / "biodance_diagnosis"
REAL = CACHE / "real.md"
"""Where bench_real_faults.py keeps its table."""
PROTOCOL = "diagnosis"
SUBJECTS = 20


def read_only(content: dict[object, object]) -> MappingProxyType[object, object]:
    """Return a mapping that cannot be written, as pickle finds it again."""
    return MappingProxyType(content)


copyreg.pickle(MappingProxyType, lambda mapping: (read_only, (dict(mapping),)))


@dataclass(frozen=True)
class Scenario:
    """One session: catalogue number of the ``subject``, ``seed`` of the person, number of the ``visit``, causes
    ``hidden`` in words, and what for: ``group`` and ``level``. Only the group "issue" has the squats that gains are
    judged on.
    """

    group: str
    subject: int
    seed: int
    visit: int = 0
    hidden: tuple[str, ...] = ()
    level: str = ""

    @property
    def key(self) -> str:
        """Name of the session on disk."""
        if not self.hidden:
            return f"{self.group}-{self.subject:02d}-{self.visit}"
        said = f"{self.subject}-{self.seed}-{self.visit}-{self.judged}-{'+'.join(self.hidden)}"
        names = "+".join(text.partition(":")[0] for text in self.hidden)
        return f"{names}-{hashlib.sha256(said.encode()).hexdigest()[:10]}"

    @property
    def judged(self) -> bool:
        """Whether trials are kept to judge gains on."""
        return self.group == "issue"


def session_folder(scenario: Scenario) -> Path:
    """Return the folder with the C3D files of a session, simulated now if it is not there."""
    folder = CACHE / "sessions" / scenario.key
    if not folder.is_dir():
        part = folder.with_name(f".{folder.name}.{os.getpid()}")
        shutil.rmtree(part, ignore_errors=True)
        subject, plan = subjects(SUBJECTS)[scenario.subject], read_protocol(PROTOCOL)
        if not scenario.judged:
            plan = replace(plan, trials=tuple(trial for trial in plan.trials if trial.role != "validate"))
        causes = tuple(parse_cause(text) for text in scenario.hidden)
        visit, loads = hide(causes, subject, plan, seed=scenario.seed, visit=LabVisit(scenario.visit))
        with patch("biodance.virtual_lab.recording.laboratory.perform", _performed):
            simulate_session(subject, plan, part, seed=scenario.seed, visit=visit, loads=loads)
        try:
            part.rename(folder)
        except OSError:  # another process made the same one meanwhile
            shutil.rmtree(part)
    return folder


def examined(scenario: Scenario) -> SessionResult:
    """Return the session after reading, preparing, scaling and tracking; identified only where gains are judged."""
    return kept(CACHE / "examined" / f"{scenario.key}.pickle", lambda: _examined(scenario))


def _examined(scenario: Scenario) -> SessionResult:
    session = read_session(session_folder(scenario))
    if scenario.judged:
        return examine(session)
    session = replace(session, trials=tuple(trial for trial in session.trials if trial.role != "validate"))
    with (
        patch("biodance.pipeline.session.can_identify", return_value=False),
        patch("biodance.pipeline.body.calibrate_joints", _placed),
        patch("biodance.pipeline.trial.track", _tracked),
    ):
        return examine(session)


class Memory(dict[str, object]):
    """What was computed in this process, forgotten as a whole when it grows too large: sessions of one person come
    one after another.
    """

    def recall(self, said: object, make: Callable[[], object]) -> object:
        """Return what belongs to ``said``, made now if it is not there."""
        key = hashlib.sha256(repr(said).encode()).hexdigest()
        if key not in self:
            if len(self) > 100:
                self.clear()
            self[key] = make()
        return self[key]


BODIES, MOTIONS, PERFORMANCES = Memory(), Memory(), Memory()
"""Sessions of one person that differ in the plates only have the same movement and the same markers."""


def _placed(scaling: Scaling, read: tuple[Prepared, ...]) -> Scaling:
    seen = tuple(one.trial.markers.xyz.tobytes() for one in read if one.trial.markers is not None)
    said = (scaling.body()[0].sip.phi.tobytes(), seen)
    return BODIES.recall(said, lambda: calibrate_joints(scaling, read))  # type: ignore[return-value]


def _tracked(body: Body, trial: Trial) -> Motion:
    assert trial.markers is not None
    said = (
        trial.name,
        trial.markers.xyz.tobytes(),
        np.asarray(body.markers.position).tobytes(),
        body.sip.phi.tobytes(),
    )
    return MOTIONS.recall(said, lambda: track(body, trial))  # type: ignore[return-value]


def _performed(person: Person, plan: TrialPlan, session: int, **how: object) -> Performance:
    body = person.loaded_body
    joints = np.array([joint.translation for joint in body.joints])
    said = (
        person.seed,
        plan,
        session,
        joints.tobytes(),
        body.sip.phi.tobytes(),
        body.markers.position.tobytes(),
        sorted(how.items(), key=str),
    )
    made = PERFORMANCES.recall(said, lambda: perform(person, plan, session, **how))  # type: ignore[arg-type]
    return made  # type: ignore[return-value]
