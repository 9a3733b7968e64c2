"""The public names of the package, each with its module: for type checkers, and for the package."""

from elevon.actuator import Actuator as Actuator
from elevon.actuator import actuators as actuators
from elevon.actuator import list_actuators as list_actuators
from elevon.calibrate.door import calibrate as calibrate
from elevon.calibrate.door import validate as validate
from elevon.campaign import load_campaign as load_campaign
from elevon.deploy import export_fmu as export_fmu
from elevon.diagnose.door import diagnose as diagnose
from elevon.diagnose.door import monitor as monitor
from elevon.diagnose.learning.door import learn as learn
from elevon.doctor.door import doctor as doctor
from elevon.doors import bench as bench
from elevon.doors import compare as compare
from elevon.doors import effects as effects
from elevon.doors import response as response
from elevon.errors import ElevonError as ElevonError
from elevon.errors import ElevonWarning as ElevonWarning
from elevon.errors import InputError as InputError
from elevon.errors import NotActingWarning as NotActingWarning
from elevon.logs.read import read_log as read_log
from elevon.nexttest.door import next_test as next_test
from elevon.prognose.door import fleet as fleet
from elevon.prognose.door import learn_growth as learn_growth
from elevon.prognose.door import next_inspection as next_inspection
from elevon.prognose.door import predict as predict
from elevon.recording import Channel as Channel
from elevon.recording import Clock as Clock
from elevon.recording import Recording as Recording
from elevon.results import Result as Result
from elevon.results import load as load
from elevon.scenario import Scenario as Scenario
from elevon.session import Fmu as Fmu
from elevon.session import Session as Session
from elevon.simulate import Run as Run
from elevon.simulate import prepare as prepare
from elevon.simulate import simulate as simulate
from elevon.simulate import simulate_batch as simulate_batch

__version__: str
