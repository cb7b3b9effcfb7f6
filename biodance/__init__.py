"""biodance: segment inertial parameters of a person, measured from markers and force plates instead of read from a
table.

A visit is diagnosed in a few lines::

    import biodance

    visit = biodance.read_session("visit")
    found = biodance.diagnose(visit)
    print(found.verdict)
    print(found.table())

SI units (m, kg, s, N, N·m, rad); lab frame with z up; a wrench is the ground's action on the subject about the lab
origin, force first. The examples of this package share a simulated visit: ``session = read_session("visit")``, ``result
= examine(session)``, ``identified = identify(result)``, ``found = diagnose(result)``, ``registered = register(...)``
and a short ``dance``; what they print is checked by the tests.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from biodance.version import __version__ as __version__

if TYPE_CHECKING:
    from biodance.body.body import Body as Body
    from biodance.body.human.human import human as human
    from biodance.body.human.scaling import scale as scale
    from biodance.dance.dance import Dance as Dance
    from biodance.diagnosis.diagnosis import Diagnosis as Diagnosis
    from biodance.diagnosis.diagnosis import Finding as Finding
    from biodance.errors import BiodanceError as BiodanceError
    from biodance.errors import FileRefused as FileRefused
    from biodance.errors import MissingLibrary as MissingLibrary
    from biodance.errors import SessionRefused as SessionRefused
    from biodance.errors import TrialRefused as TrialRefused
    from biodance.errors import UnknownName as UnknownName
    from biodance.identification.identification import Identification as Identification
    from biodance.lab.readers import read_trial as read_trial
    from biodance.lab.readers.c3d import read_c3d as read_c3d
    from biodance.lab.session.read import read_session as read_session
    from biodance.motion.dynamics import predict_wrench as predict_wrench
    from biodance.motion.track import track as track
    from biodance.pipeline.dance import DanceResult as DanceResult
    from biodance.pipeline.export import export as export
    from biodance.pipeline.front import SessionComparison as SessionComparison
    from biodance.pipeline.front import compare_sessions as compare_sessions
    from biodance.pipeline.front import diagnose as diagnose
    from biodance.pipeline.front import identify as identify
    from biodance.pipeline.front import register as register
    from biodance.pipeline.front_dance import design_dance as design_dance
    from biodance.pipeline.front_dance import simulate as simulate
    from biodance.pipeline.front_dance import verify_dance as verify_dance
    from biodance.pipeline.identification import SessionIdentification as SessionIdentification
    from biodance.pipeline.learn import judge_plates as judge_plates
    from biodance.pipeline.learn import learn_laboratory as learn_laboratory
    from biodance.pipeline.live import stream_recording as stream_recording
    from biodance.pipeline.movement import SessionMovement as SessionMovement
    from biodance.pipeline.movement import describe_movement as describe_movement
    from biodance.pipeline.results import SessionDiagnosis as SessionDiagnosis
    from biodance.pipeline.results import SessionResult as SessionResult
    from biodance.pipeline.robot import identify_robot as identify_robot
    from biodance.pipeline.session import examine as examine
    from biodance.records import FootSizes as FootSizes
    from biodance.records import Markers as Markers
    from biodance.records import Motion as Motion
    from biodance.records import Plate as Plate
    from biodance.records import Session as Session
    from biodance.records import Sip as Sip
    from biodance.records import Subject as Subject
    from biodance.records import Trial as Trial
    from biodance.records import Wrench as Wrench
    from biodance.registration import Registration as Registration
    from biodance.settings import Settings as Settings

HOMES = {
    "body.body": ("Body",),
    "body.human.human": ("human",),
    "body.human.scaling": ("scale",),
    "dance.dance": ("Dance",),
    "diagnosis.diagnosis": ("Diagnosis", "Finding"),
    "errors": ("BiodanceError", "FileRefused", "MissingLibrary", "SessionRefused", "TrialRefused", "UnknownName"),
    "identification.identification": ("Identification",),
    "lab.readers.c3d": ("read_c3d",),
    "lab.readers": ("read_trial",),
    "lab.session.read": ("read_session",),
    "motion.dynamics": ("predict_wrench",),
    "motion.track": ("track",),
    "pipeline.dance": ("DanceResult",),
    "pipeline.export": ("export",),
    "pipeline.front": ("SessionComparison", "compare_sessions", "diagnose", "identify", "register"),
    "pipeline.front_dance": ("design_dance", "simulate", "verify_dance"),
    "pipeline.identification": ("SessionIdentification",),
    "pipeline.learn": ("judge_plates", "learn_laboratory"),
    "pipeline.live": ("stream_recording",),
    "pipeline.movement": ("SessionMovement", "describe_movement"),
    "pipeline.results": ("SessionDiagnosis", "SessionResult"),
    "pipeline.robot": ("identify_robot",),
    "pipeline.session": ("examine",),
    "records": ("FootSizes", "Markers", "Motion", "Plate", "Session", "Sip", "Subject", "Trial", "Wrench"),
    "registration": ("Registration",),
    "settings": ("Settings",),
}
"""Module -> the names of the front door that live there; each is loaded when it is first asked for."""
_HOME = {name: f"{__name__}.{module}" for module, names in HOMES.items() for name in names}
__all__ = sorted(_HOME)  # noqa: PLE0605 - one list, checked against the imports above by a test


def front_door(name: str) -> Any:
    """Return what a name of the front door stands for, from where it lives."""
    return getattr(import_module(_HOME[name]), name)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}. It has {', '.join(__all__)}.")
    return globals().setdefault(name, front_door(name))


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
