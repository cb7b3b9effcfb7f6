"""Vicon's files beside the recording: measurements, skeleton, Eclipse notes, in the encodings and line ends of
Windows.
"""

import pytest

from biodance.errors import FileRefused
from biodance.lab.session.recordings import read_enf, read_mp, read_vsk


def write(tmp_path, name, text, encoding="utf-8", end="\r\n"):
    path = tmp_path / name
    path.write_bytes(text.replace("\n", end).encode(encoding))
    return path


MP = (
    "$Name = Anna\n$Bodymass = 66.2\n$Height = 1890\n$LLegLength=912.5\n$RTibialTorsion = 12\n$LSoleDelta = "
    "0\n$MarkerDiameter = 14\n"
)


@pytest.mark.parametrize(
    ("encoding", "end"), [("utf-8", "\n"), ("utf-8-sig", "\r\n"), ("utf-16", "\r\n"), ("cp1252", "\r")]
)
def test_mp_gives_metres_and_kilograms(tmp_path, encoding, end):
    measures = read_mp(write(tmp_path, "Anna.mp", MP, encoding, end))
    assert measures == pytest.approx({"Bodymass": 66.2, "Height": 1.89, "LLegLength": 0.9125, "MarkerDiameter": 0.014})


def test_mp_with_decimal_comma(tmp_path):
    assert read_mp(write(tmp_path, "a.mp", "$Bodymass = 66,2\n"))["Bodymass"] == pytest.approx(66.2)


@pytest.mark.parametrize(
    ("text", "sentence"), [("", "is empty"), ("hello\n", "no row such as"), ("$A = 1.2.3\n", "is not a number")]
)
def test_wrong_mp_is_refused(tmp_path, text, sentence):
    with pytest.raises(FileRefused, match=sentence):
        read_mp(write(tmp_path, "a.mp", text))


VSK = """<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<KinematicModel MODEL="PlugInGait FullBody" VERSION="3.2">
 <Parameters>
  <StaticParameter NAME="Bodymass" VALUE="72" PRIOR="65" READONLY="false" REQUIRED="true" QUANTITY="mass"/>
  <StaticParameter NAME="Height" VALUE="1730" PRIOR="1700" READONLY="0" QUANTITY="length"/>
  <StaticParameter NAME="LeftLegLength" VALUE="1000" READONLY="0" QUANTITY="length"/>
  <StaticParameter NAME="RightKneeWidth" PRIOR="120" READONLY="0" QUANTITY="length"/>
  <StaticParameter NAME="LeftStaticPlantFlex" VALUE="0.13" READONLY="1" QUANTITY="angle"/>
  <StaticParameter NAME="PelvisLength" VALUE="140" READONLY="1" QUANTITY="length"/>
  <Parameter NAME="LTHIz" VALUE="-246.7" PRIOR="-200" SD="0"/>
 </Parameters>
</KinematicModel>
"""


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_vsk_gives_what_was_typed_in(tmp_path, encoding):
    measures = read_vsk(write(tmp_path, "Anna.vsk", VSK, encoding))
    assert measures == pytest.approx({"Bodymass": 72.0, "Height": 1.73, "LLegLength": 1.0})


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<KinematicModel>", "not valid XML"),
        ("<Scene/>", "its root is <Scene>"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><KinematicModel/>', "XML entities"),
        (VSK.replace('"72"', '"heavy"'), "'heavy' is not a number"),
    ],
)
def test_wrong_vsk_is_refused(tmp_path, text, sentence):
    with pytest.raises(FileRefused, match=sentence):
        read_vsk(write(tmp_path, "a.vsk", text))


ENF = """[Node Information]
TYPE=TRIAL
NAME=Walk 03
[TRIAL_INFO]
CREATIONDATEANDTIME=2024,5,6,10,20,30
DESCRIPTION=barfuß = schnell
NOTES=Gurt rechts; [locker]
TYPE=Dynamic
FP2=Invalid
FP1=Right
SUBJECTS=Anna
"""


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_enf_is_read_in_every_encoding(tmp_path, encoding):
    notes = read_enf(write(tmp_path, "Walk 03.Trial12.enf", ENF, encoding))
    assert notes.trial == "Walk 03"
    assert notes.type == "Dynamic"
    assert notes.description == "barfuß = schnell"
    assert notes.notes == "Gurt rechts; [locker]"
    assert dict(notes.plates) == {"FP1": "Right", "FP2": "Invalid"}
    assert notes.fields["SUBJECTS"] == "Anna"


def test_enf_without_a_type_says_nothing(tmp_path):
    notes = read_enf(write(tmp_path, "a.Trial.enf", "[Node Information]\nTYPE=TRIAL\n"))
    assert (notes.trial, notes.type, dict(notes.plates)) == ("a", "", {})
