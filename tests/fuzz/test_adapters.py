"""Adapters that return, raise or do what the protocol does not have."""

from unittest import mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzz.campaign import cases
from fuzz.cases import run, surroundings
from fuzz.inputs import ADAPTER, BALL_FILE, DRIFT_FILE

EVIL = '''
def no(*given, **named):
    raise RuntimeError("no \\ud800 \\x1b[2J")
class Evil:
    """Every question about it raises."""
    __repr__ = __str__ = __eq__ = __hash__ = __bool__ = __len__ = __iter__ = __float__ = __int__ = __index__ = __getattr__ = no
    __array__ = __lt__ = __le__ = __add__ = __mul__ = __neg__ = __abs__ = __contains__ = __getitem__ = __reduce_ex__ = no
class Unfinished(Drifting):
    """A simulation without a state."""
    __init__ = lambda self: None
class Batch(BatchSimulation):
    advance = states = no
class Word(str):
    __repr__ = __str__ = __format__ = no
class Real(float):
    __repr__ = __str__ = __float__ = no
cycle = []
cycle.append(cycle)
cycles = {}
cycles["itself"] = cycles
deep = []
for _ in range(100_000): deep = [deep]
'''
ANSWERS = r"""
None True False 0 1 -1 2.5 10**400 10**5000 -0.0 1e308 1e-320 float('nan') float('inf') 1j '' 'four' '\ud800' '\x1b[2J' 'x'*10**6
b'bytes' [] () {} [1,2] ['a'] [None] {'a':1} {1:2} {(1,2):3} {'\ud800':1} {'a':{'b':'\ud800'}} {'a':float('nan')} {'x'*10**6:1}
{'a':np.zeros(3)} cycle cycles deep {'deep':deep} Evil() Evil [Evil()] {'a':Evil()} Word('four') Real(4.0) {'a':Word('b')} object
object() type no range(10) map(str,[1]) iter([]) np np.float32 np.float64(1.0) np.float32(0.5) np.int64(3) np.bool_(True)
np.nan np.ma.masked np.str_('x') np.zeros(13) np.zeros(12) np.zeros((13,13)) np.full(13,np.nan) np.full(13,np.inf) np.zeros(13,complex)
np.zeros(13,'f4') np.zeros(13,'O') np.array(['x']*13) np.zeros((0,13)) np.zeros((5,13)) np.zeros((11,13)) np.ones((11,13))
np.zeros((41,13)) np.array(None) list(range(13)) [0.0]*13 np.ma.masked_all(13) np.zeros(13,'M8[s]') np.full(13,1e308) np.arange(13.0)
AsBuilt(1.0,np.eye(3),np.zeros(3)) AsBuilt(None,None,None) AsBuilt('a',np.eye(2),[0]) AsBuilt(np.nan,np.full((3,3),np.nan),np.zeros(4))
[KnownLimitation('x')] [KnownLimitation(b'x')] KnownLimitation('x') [KnownLimitation('x',{'drift':'y'})]
[KnownLimitation('x',{1:np.nan})] [KnownLimitation('x',{'energy_error':-1})] [KnownLimitation(Evil(),Evil())] (NumericOption(1,2,3),)
{'tolerance':NumericOption(None,'a',{})} {'tolerance':NumericOption(0.1,0.0,float('inf'))} {'method':()} {'method':('one',)}
{'method':'one'} {'method':(1,2)} {'tolerance':(0.1,0.2,0.3)} {'tolerance':(0.1,'x',None)} {'tolerance':(5.0,6.0,7.0)}
{'a[b':('[','\n')} Drifting Unfinished() Batch() sys.stdout threading.Lock() types.SimpleNamespace()
"""
VALUES = st.sampled_from(ANSWERS.split())
ACTIONS = st.sampled_from(
    [
        "os._exit(0)",
        "os._exit(7)",
        "os.abort()",
        "os.kill(os.getpid(), signal.SIGTERM)",
        "sys.exit(0)",
        "no()",
        "(_ for _ in ()).throw(KeyboardInterrupt)",
        "(_ for _ in ()).throw(GeneratorExit)",
        "(_ for _ in ()).throw(type('E', (BaseException,), {'__str__': no})())",
        "(_ for _ in ()).throw(StopIteration)",
        "[os.close(number) for number in range(3, 60)]",
        "subprocess.Popen(['sleep', '1000'])",
        "bytearray(2**40)",
        "print('\\x1b[2J', flush=True)",
        "os.write(2, b'Traceback (most recent call last)')",
        "sys.setrecursionlimit(30)",
        "os.environ.clear()",
        "sys.modules.clear()",
        "sys.path.clear()",
        "os.chdir('/')",
        "os.rmdir(os.getcwd())",
        "setattr(np, 'asarray', None)",
        "signal.alarm(1)",
        "os.fork()",
    ]
)
ENDLESS = st.sampled_from(
    [
        "os.kill(os.getpid(), signal.SIGSTOP)",
        "threading.Thread(target=lambda: [None for _ in iter(int, 1)]).start()",
        "[None for _ in iter(int, 1)]",
        "signal.signal(signal.SIGXCPU, signal.SIG_IGN) and [None for _ in iter(int, 1)]",
        "threading.Event().wait()",
    ]
)
NAMED = r"""
Mine.name Mine.label Mine.order Mine.precision Mine.choices Mine.numbers Mine.accuracy Mine.reasons Mine.options Mine.__doc__
Mine.__module__ Drifting.settings Drifting.settings Drifting.known_limitations Drifting.known_limitations Drifting.velocity_lag
"""
ATTRIBUTES = st.sampled_from(NAMED.split())
CALLED_BY_DROPSPIN = r"""
Mine.__init__ Mine.__post_init__ Mine.order_in Mine.discretisation Mine.predicted_error Mine.declines Mine.programs Mine.prepare
Mine.prepare_batch Mine.option Mine.accuracy_levels Mine.refined Drifting.__init__ Drifting.advance Drifting.state
Drifting.state Drifting.record Drifting.as_built Drifting.close Drifting.__enter__ Drifting.__exit__
"""
METHODS = st.sampled_from(CALLED_BY_DROPSPIN.split())
CHANGES = st.one_of(
    st.tuples(ATTRIBUTES, VALUES).map(" = ".join),
    st.tuples(ATTRIBUTES, VALUES | ACTIONS).map(lambda pair: f"{pair[0]} = property(lambda self: {pair[1]})"),
    st.tuples(METHODS, VALUES).map(lambda pair: f"{pair[0]} = lambda *given, **named: {pair[1]}"),
    st.tuples(METHODS, VALUES).map(lambda pair: f"{pair[0]} = {pair[1]}"),
    st.tuples(METHODS, ACTIONS).map(lambda pair: f"{pair[0]} = lambda *given, **named: {pair[1]}"),
    ACTIONS,
)
CHECKS = ("claims", "declines", "builds what is meant", "repeats", "settings", "files", "bouncing ball")
OUTPUT = ("--time-limit", "1", "-o", "out")
RUN = ("run", "drift.toml", "-e", "mine:Mine", "-e", "wang", "--dt", "0.02", *OUTPUT)
SEVERAL_STEPS = ("run", "ball.toml", "-e", "mine:Mine[method=two]", "--dt", "0.04", "--dt", "0.02", "--dt", "0.01", "--json", *OUTPUT)
SHOW = ("show", "drift.toml", "-e", "mine:Mine")
COMMANDS = st.sampled_from([RUN, SEVERAL_STEPS, SHOW, (*SHOW, "--json"), ("sweep", "spec.toml", *OUTPUT)])
STUDIES = st.sampled_from(
    [
        ("conform", "mine:Mine", "--time-limit", "1", *(f"--check={check}" for check in CHECKS)),
        ("tradeoff", "drift.toml", "-e", "mine:Mine", "--budget", "0.1", "-o", "out"),
        ("limits", "drift.toml", "-e", "mine:Mine", "--axis", "step", *OUTPUT),
        ("calibrate", "-e", "mine:Mine", "--restitution", "0.5", "--dt", "0.02"),
    ]
)
SPEC = 'scenes = ["drift.toml"]\nengines = ["mine:Mine", "wang"]\ndts = [0.02]\n[grid]\n"body.mass" = [1.0, 2.0]\n'


def run_with(changes, command):
    """Run a command with an adapter that is changed."""
    with surroundings() as work, mock.patch("dropspin.comparisons.running.processes.WALL_TIME_FACTOR", 3.0):
        for name, text in {"drift.toml": DRIFT_FILE, "ball.toml": BALL_FILE, "spec.toml": SPEC}.items():
            (work / name).write_text(text)
        (work / "mine.py").write_text("\n".join([ADAPTER, EVIL, *changes, ""]))
        run(work, *command, outputs=["out"])


@cases(80)
@given(st.lists(CHANGES, min_size=1, max_size=2), COMMANDS)
def test_answers_of_an_adapter_are_used_or_cost_its_rows(changes, command):
    run_with(changes, command)


@cases(50)
@given(st.lists(CHANGES, min_size=1, max_size=2), STUDIES)
def test_answers_of_an_adapter_are_used_or_end_its_study(changes, command):
    run_with(changes, command)


@pytest.mark.extended
@cases(20)
@given(METHODS.map(lambda method: f"{method} = lambda *given, **named: ") | st.just(""), ENDLESS)
def test_adapters_that_never_answer_cost_their_rows(place, action):
    """In a run, whose limit of time is that of the import and the construction too."""
    run_with([f"{place}{action}"], RUN)
