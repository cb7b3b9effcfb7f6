"""The frozen records that every stage of biodance speaks.

Conventions, everywhere behind the reader: SI units (m, kg, s, N, N·m, rad); lab frame with z up; wrenches are the
ground's action ON the subject, about the lab origin, force first; time is the first axis; NaN means "not seen". Arrays
are copied, checked for shape at birth and read-only afterwards; change a record with ``dataclasses.replace``.
"""

from biodance.records.arrays import CHANNEL_TITLES as CHANNEL_TITLES
from biodance.records.arrays import CHANNELS as CHANNELS
from biodance.records.arrays import Array as Array
from biodance.records.arrays import Index as Index
from biodance.records.arrays import Mask as Mask
from biodance.records.arrays import any_coordinate as any_coordinate
from biodance.records.arrays import assign as assign
from biodance.records.arrays import by_name as by_name
from biodance.records.arrays import freeze as freeze
from biodance.records.arrays import frozen_array as frozen_array
from biodance.records.arrays import grouped as grouped
from biodance.records.arrays import lengths_of as lengths_of
from biodance.records.arrays import longest_run as longest_run
from biodance.records.arrays import runs as runs
from biodance.records.arrays import spread_frames as spread_frames
from biodance.records.attention import LeftOut as LeftOut
from biodance.records.motion import AngleSpan as AngleSpan
from biodance.records.motion import AngleState as AngleState
from biodance.records.motion import Motion as Motion
from biodance.records.session import ROLES as ROLES
from biodance.records.session import SIDES as SIDES
from biodance.records.session import FootSizes as FootSizes
from biodance.records.session import Role as Role
from biodance.records.session import Session as Session
from biodance.records.session import Sip as Sip
from biodance.records.session import Subject as Subject
from biodance.records.session import Trial as Trial
from biodance.records.session import side_in_name as side_in_name
from biodance.records.wrench import Defect as Defect
from biodance.records.wrench import FootEvent as FootEvent
from biodance.records.wrench import LeftOutSpan as LeftOutSpan
from biodance.records.wrench import Markers as Markers
from biodance.records.wrench import Plate as Plate
from biodance.records.wrench import Source as Source
from biodance.records.wrench import Wrench as Wrench
from biodance.records.wrench import contact_times as contact_times
from biodance.records.wrench import contacts as contacts
