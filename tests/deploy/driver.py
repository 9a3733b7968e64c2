"""An importer of our own: the functions of both versions by ctypes, with their exact types."""

import ctypes
import zipfile
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p
from pathlib import Path
from xml.etree.ElementTree import fromstring

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
LOGGER2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
LOGGER3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class Callbacks(ctypes.Structure):
    """``fmi2CallbackFunctions``."""

    _fields_ = [
        ("logger", LOGGER2),
        ("allocate", c_void_p),
        ("free", c_void_p),
        ("finished", c_void_p),
        ("environment", c_void_p),
    ]


class Fmu:
    """An unpacked FMU: its description, its library."""

    def __init__(self, path, folder):
        self.folder = Path(folder)
        with zipfile.ZipFile(path) as file:
            file.extractall(self.folder)
            self.names = file.namelist()
        self.root = fromstring((self.folder / "modelDescription.xml").read_text("utf-8"))
        self.version = self.root.get("fmiVersion")
        self.two = self.version == "2.0"
        self.token = self.root.get("guid" if self.two else "instantiationToken")
        entries = list(self.root.find("ModelVariables"))
        self.references = {e.get("name"): int(e.get("valueReference")) for e in entries}
        kind = (lambda e: e[0].tag) if self.two else (lambda e: e.tag)
        self.types = {e.get("name"): kind(e) for e in entries}
        (binary,) = (name for name in self.names if name.startswith("binaries/"))
        self.library = ctypes.CDLL(str(self.folder / binary))

    @property
    def resources(self):
        folder = self.folder / "resources"
        return (folder.as_uri() if self.two else f"{folder}/").encode()


class Component:
    """An instance; every call returns its status, what was logged stands in `texts`."""

    def __init__(self, fmu, token=None, resources=None, events=False):
        self.fmu, self.lib, self.texts = fmu, fmu.library, []
        token = (token or fmu.token).encode()
        resources = fmu.resources if resources is None else resources
        if fmu.two:
            log = lambda _e, _n, status, _c, text: self.texts.append((status, text.decode()))  # noqa: E731
            self._logger = LOGGER2(log)
            self._callbacks = Callbacks(self._logger)
            make = self.lib.fmi2Instantiate
            make.restype = c_void_p
            self.handle = make(b"one", c_int(1), token, resources, byref(self._callbacks),
                               c_int(0), c_int(0))  # fmt: skip
        else:
            self._logger = LOGGER3(lambda _e, s, _c, text: self.texts.append((s, text.decode())))
            make = self.lib.fmi3InstantiateCoSimulation
            make.restype = c_void_p
            self.handle = make(b"one", token, resources, c_bool(False), c_bool(False),
                               c_bool(events), c_bool(False), None, c_size_t(0), None,
                               self._logger, None)  # fmt: skip

    def call(self, name, *arguments):
        return getattr(self.lib, f"fmi{self.fmu.version[0]}{name}")(
            c_void_p(self.handle), *arguments
        )

    def begin(self, start=0.0, **values):
        """Set values before the start, and initialise."""
        status = self.set(**values) if values else OK
        if self.fmu.two:
            status = max(status, self.call("SetupExperiment", c_int(0), c_double(0),
                                           c_double(start), c_int(0), c_double(0)),
                         self.call("EnterInitializationMode"))  # fmt: skip
        else:
            status = max(status, self.call("EnterInitializationMode", c_bool(False), c_double(0),
                                           c_double(start), c_bool(False),
                                           c_double(0)))  # fmt: skip
        return max(status, self.call("ExitInitializationMode"))

    def _function(self, name):
        kind = self.fmu.types[name]
        if self.fmu.two:
            return ("Real", c_double) if kind == "Real" else ("Integer", c_int)
        return {
            "Float64": ("Float64", c_double),
            "Int32": ("Int32", ctypes.c_int32),
            "Enumeration": ("Int64", ctypes.c_int64),
        }[kind]

    def set(self, **values):
        """Set variables by name (dots as they are: pass a mapping with **)."""
        status = OK
        for name, value in values.items():
            function, kind = self._function(name)
            status = max(status, self.set_raw(function, [self.fmu.references[name]], [value], kind))
        return status

    def set_raw(self, function, references, values, kind=c_double):
        count = len(references)
        row = (c_uint32 * count)(*references)
        numbers = (kind * count)(*values)
        extra = () if self.fmu.two else (c_size_t(count),)
        return self.call(f"Set{function}", row, c_size_t(count), numbers, *extra)

    def get(self, *names):
        return [self.get_raw(*self._function(n), [self.fmu.references[n]])[1][0] for n in names]

    def get_raw(self, function, kind, references):
        count = len(references)
        row, numbers = (c_uint32 * count)(*references), (kind * count)()
        extra = () if self.fmu.two else (c_size_t(count),)
        status = self.call(f"Get{function}", row, c_size_t(count), numbers, *extra)
        return status, list(numbers)

    def outputs(self, names):
        function, kind = ("Real", c_double) if self.fmu.two else ("Float64", c_double)
        status, values = self.get_raw(function, kind, [self.fmu.references[n] for n in names])
        assert status == OK, self.texts
        return values

    def step(self, time, step):
        if self.fmu.two:
            return self.call("DoStep", c_double(time), c_double(step), c_int(1))
        self.told = (c_bool(), c_bool(), c_bool(), c_double())
        return self.call("DoStep", c_double(time), c_double(step), c_bool(True),
                         *(byref(x) for x in self.told))  # fmt: skip

    @property
    def _state(self):
        return "FMUstate" if self.fmu.two else "FMUState"

    def save(self):
        state = c_void_p()
        assert self.call(f"Get{self._state}", byref(state)) == OK, self.texts
        return state

    def restore(self, state):
        return self.call(f"Set{self._state}", state)

    def release(self, state):
        return self.call(f"Free{self._state}", byref(state))

    def serialise(self, state):
        size = c_size_t()
        assert self.call(f"Serialized{self._state}Size", state, byref(size)) == OK
        data = ctypes.create_string_buffer(size.value)
        assert self.call(f"Serialize{self._state}", state, data, size) == OK
        return data.raw

    def read_state(self, data):
        name = f"DeSerialize{self._state}" if self.fmu.two else f"Deserialize{self._state}"
        state = c_void_p()
        status = self.call(name, ctypes.create_string_buffer(data, len(data)),
                           c_size_t(len(data)), byref(state))  # fmt: skip
        return status, state

    def free(self):
        if self.handle:
            self.call("FreeInstance")
            self.handle = None


class CRun:
    """The C interface by ctypes."""

    def __init__(self, library, document):
        self.lib = lib = ctypes.CDLL(str(library))
        for name in ("elevon_message", "elevon_code_text", "elevon_version"):
            getattr(lib, name).restype = c_char_p
        lib.elevon_message.argtypes = [c_void_p]
        self.run, room = c_void_p(), ctypes.create_string_buffer(500)
        self.code = lib.elevon_create(document.encode(), byref(self.run), room, c_size_t(500))
        self.reason = room.value.decode()

    def call(self, name, *arguments):
        return getattr(self.lib, f"elevon_{name}")(self.run, *arguments)

    def find(self, what, name):
        index = c_size_t()
        assert self.call("find", c_int(what), name.encode(), byref(index)) == 0, name
        return index.value

    def set_input(self, name, value):
        return self.call("set_input", c_size_t(self.find(0, name)), c_double(value))

    def set_fault(self, name, severity):
        return self.call("set_fault", c_size_t(self.find(2, name)), c_double(severity))

    def step(self, seconds):
        return self.call("step", c_double(seconds))

    def read(self):
        count = c_size_t()
        self.call("describe", None, None, None, byref(count), None)
        values = (c_double * count.value)()
        assert self.call("read", values, count) == 0
        return list(values)

    def save(self):
        size = c_size_t()
        assert self.call("state_size", byref(size)) == 0
        data = ctypes.create_string_buffer(size.value)
        assert self.call("save", data, size) == 0
        return data.raw

    def restore(self, data):
        return self.call(
            "restore", ctypes.create_string_buffer(data, len(data)), c_size_t(len(data))
        )

    def message(self):
        return self.lib.elevon_message(self.run).decode()

    def free(self):
        self.lib.elevon_free(self.run)
        self.run = c_void_p()
