"""What ``import biodance`` conducts about what moved; the commands call the same function."""

from collections.abc import Callable
from pathlib import Path

from biodance.lab.session.read import read_session
from biodance.pipeline.movement import SessionMovement, session_movement
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine
from biodance.records import Session


def describe_movement(
    session: Session | SessionResult | str | Path, *, tell: Callable[[str], None] = lambda _: None
) -> SessionMovement:
    """Return what moved in every trial of a visit: events, cycles, angles, moments, powers, spatio-temporal values.

    Parameters
    ----------
    session : Session, SessionResult, str or pathlib.Path
        The visit: as `read_session` or `examine` return it, or its folder.
    tell : callable, optional
        Called with what is being done, in words.

    Returns
    -------
    SessionMovement
        ``moved["walk_1"].curve("knee_flexion", "left")`` holds all repetitions over 0 to 100 % with mean and sd, in
        degrees; moments in N·m/kg and powers in W/kg with what the inertial parameters leave uncertain in them.

    Raises
    ------
    SessionRefused
        The folder holds no session.

    See Also
    --------
    examine : All stages of a visit.

    References
    ----------
    Joint axes: Wu et al. 2002, doi:10.1016/S0021-9290(01)00222-6. Events: Zeni et al. 2008,
    doi:10.1016/j.gaitpost.2007.07.007. Pelvis: Baker 2001, doi:10.1016/S0966-6362(00)00083-7.

    Examples
    --------
    >>> moved = biodance.describe_movement(result)
    >>> bool(moved["squat_1"].curve("knee_flexion", "left").mean.max() > 60)
    True
    """
    if not isinstance(session, SessionResult):
        read = session if isinstance(session, Session) else read_session(session, tell=tell)
        session = examine(read, tell=tell)
    return session_movement(session, tell=tell)
