"""Runs on a GPU: through its driver alone, in chunks that fit its memory, with copies beside the work.

A thread advances one run by the kernel of :mod:`nearharmonic.core.gpu`, with the bits of a processor. Two chunks take
turns: while one is computed, the results of the other are copied and its place is filled. A launch takes a fraction of
a second, so that Ctrl-C is seen between two of them; long runs go on in the next launch.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Mapping, Sequence
from functools import cache
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.gpu import GENERATION, MemberKernel, build_member
from nearharmonic.core.layout import FAR, LOOKS, MEMBER, PROGRESS, STOP, running_at, running_rows
from nearharmonic.engine.kernels import physics_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import CompiledCodeError, MissingPackageError, NearharmonicError, bad_setting
from nearharmonic.integrators.tableau import Composition
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

#: Threads of a block, and runs of a chunk, at most: 2**18 runs of a planar system take 160 megabytes.
BLOCK, CHUNK = 128, 2**18
#: Share of the free memory that chunks may take; and least runs of a chunk, a block.
SHARE, LEAST = 0.8, BLOCK
#: Seconds that a launch should take, steps of the first one, and seconds between looks at the driver.
LAUNCH, FIRST, PATIENCE = 0.2, 256, 5e-4
#: "auto" takes a GPU for so many runs and force evaluations, if doubles take at most so many times as long as floats.
RUNS, EVALUATIONS, RATIO = 2**14, 10**9, 4

#: Arrays that go to the GPU for each chunk, come back from it, and stay there.
SENT, RETURNED = ("marks", "scheme", "start", "parameters"), (
    "states", "energy_error", "worst", "total", "energy", "running", "left_at",
)  # fmt: skip
STAYING = ("work", "at", "mark")
INTEGERS = ("marks", "scheme", "left_at", "at", "mark")


class DriverError(NearharmonicError):
    """A call of the driver of a GPU that failed."""


class Gpu:
    """The first GPU of this computer, by a driver with the functions of ``cuda.bindings.driver``."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver
        self.call("cuInit", 0)
        (self.device,) = self.call("cuDeviceGet", 0)
        (self.context,) = self.call("cuDevicePrimaryCtxRetain", self.device)
        self.enter()
        major, minor = (self.attribute(f"COMPUTE_CAPABILITY_{part}") for part in ("MAJOR", "MINOR"))
        self.generation = 10 * major + minor
        (name,) = self.call("cuDeviceGetName", 256, self.device)
        self.name = name.decode().strip("\0") if isinstance(name, bytes) else str(name)
        self._functions = dict[str, Any]()

    def call(self, name: str, *given: Any) -> tuple[Any, ...]:
        """Call a function of the driver and return its results; a :class:`DriverError` says what failed."""
        code, *found = getattr(self.driver, name)(*given)
        if int(code) != 0:
            raise DriverError(f"{name}: {getattr(code, 'name', code)}")
        return tuple(found)

    def attribute(self, name: str) -> int:
        """Return an attribute of the device."""
        kind = getattr(self.driver.CUdevice_attribute, f"CU_DEVICE_ATTRIBUTE_{name}")
        return int(self.call("cuDeviceGetAttribute", kind, self.device)[0])

    def enter(self) -> None:
        """Make this GPU the one of the current thread."""
        self.call("cuCtxSetCurrent", self.context)

    def function(self, kernel: MemberKernel) -> Any:
        """Return the compiled function of a kernel."""
        text = kernel.ptx
        if text not in self._functions:
            image = np.frombuffer(text.encode() + b"\0", np.uint8)
            (module,) = self.call("cuModuleLoadData", image.ctypes.data)
            (self._functions[text],) = self.call("cuModuleGetFunction", module, b"member")
        return self._functions[text]

    def free_memory(self) -> int:
        """Return the bytes of free memory."""
        return int(self.call("cuMemGetInfo")[0])


@cache
def gpu() -> Gpu:
    """Return the GPU; a NearharmonicError says in a sentence what was looked for and not found."""
    try:
        from cuda.bindings import driver
    except ImportError as error:
        raise MissingPackageError("a run on a GPU", "cuda-bindings", "gpu") from error
    wanted = f"a GPU of NVIDIA of compute capability {GENERATION / 10} or later, with its driver"
    try:
        found = Gpu(driver)
    except (DriverError, RuntimeError, OSError) as error:
        raise bad_setting("device", "gpu", f"it needs {wanted}; {error}") from error
    if found.generation < GENERATION:
        raise bad_setting("device", "gpu", f"it needs {wanted}; {found.name} has {found.generation / 10}")
    return found


def device_of(asked: str, system: System, step: Composition, numerics: Numerics, runs: int, steps: int) -> str:
    """Return "cpu" or "gpu" for the setting ``device`` and so many runs and steps of all together.

    A GPU that is asked for and cannot be had is an error. "auto" takes one where it is faster.
    """
    if asked == "gpu":
        gpu(), member_kernel(system, numerics.compiled, **step.kernel_options)
    if asked != "auto":
        return asked
    if runs < RUNS or steps * step.stages < EVALUATIONS:
        return "cpu"
    try:
        slower = gpu().attribute("SINGLE_TO_DOUBLE_PRECISION_PERF_RATIO")
        member_kernel(system, numerics.compiled, **step.kernel_options)
    except NearharmonicError:
        return "cpu"
    return "gpu" if slower <= RATIO else "cpu"


@remembered
def member_kernel(system: System, numerics: Numerics, *, modified: bool = False, stages: int = 0) -> MemberKernel:
    """Return the kernel of a run a thread; a form that a GPU does not compute is a SettingError."""
    physics = physics_of(system, numerics, modified=modified, stages=stages)
    try:
        return build_member(
            physics, extended=numerics.precision == "extended", compensated=numerics.compensated, energy=numerics.energy
        )
    except CompiledCodeError as error:
        raise bad_setting("device", "gpu", f"{error}; use device='cpu'") from error


# --- Memory: the arrays of a chunk, with the run as their last axis.


def numbers_of_a_run(d: int, parameters: int, samples: int, own_parameters: bool) -> dict[str, int]:
    """Return the numbers of 8 bytes that a run has in each array on the GPU."""
    running = running_rows(d)
    return {
        "marks": samples, "scheme": 1, "start": 4 * d, "parameters": parameters if own_parameters else 0,
        "states": 4 * d * samples, "energy_error": samples, "worst": samples, "total": samples, "energy": 2,
        "running": running, "left_at": 1, "work": running_at(d, parameters // 2) + running, "at": 1, "mark": 1,
    }  # fmt: skip


def runs_of_a_chunk(runs: int, numbers: int, free: int) -> int:
    """Return the runs of a chunk of ``numbers`` of 8 bytes each, two of which fit in ``free`` bytes of memory."""
    most = int(SHARE * free) // (2 * 8 * numbers)
    if most < min(runs, LEAST):
        needed = 2 * 8 * numbers * min(runs, LEAST) / SHARE
        raise bad_setting("device", "gpu", f"{needed:.1e} bytes of free memory; the GPU has {free:.1e}")
    return min(runs, CHUNK, most)


class _Slot:
    """A place for a chunk: a stream, arrays on the GPU, and arrays of the same shapes that it copies from and to."""

    def __init__(self, gpu: Gpu, shapes: Mapping[str, tuple[int, ...]]) -> None:
        self.gpu, self.chunk = gpu, slice(0, 0)
        (self.stream,) = gpu.call("cuStreamCreate", 0)
        self.device, self.host = dict[str, Any](), dict[str, NDArray[Any]]()
        for name, shape in shapes.items():
            size = 8 * max(1, int(np.prod(shape)))
            (self.device[name],) = gpu.call("cuMemAlloc", size)
            if name not in STAYING:
                (place,) = gpu.call("cuMemAllocHost", size)
                kind = ctypes.c_int64 if name in INTEGERS else ctypes.c_double
                self.host[name] = np.ctypeslib.as_array((kind * int(np.prod(shape))).from_address(int(place))).reshape(
                    shape
                )

    def free(self) -> None:
        for place in self.device.values():
            self.gpu.call("cuMemFree", place)
        for array in self.host.values():
            self.gpu.call("cuMemFreeHost", array.ctypes.data)
        self.gpu.call("cuStreamDestroy", self.stream)

    def copy(self, names: Sequence[str], to_gpu: bool) -> None:
        """Copy arrays, beside what the processor does next."""
        for name in names:
            array = self.host[name]
            if array.size and to_gpu:
                self.gpu.call("cuMemcpyHtoDAsync", self.device[name], array.ctypes.data, array.nbytes, self.stream)
            elif array.size:
                self.gpu.call("cuMemcpyDtoHAsync", array.ctypes.data, self.device[name], array.nbytes, self.stream)

    def busy(self) -> bool:
        """True while something that the stream was given is not done."""
        code = self.gpu.driver.cuStreamQuery(self.stream)[0]
        if int(code) not in (0, NOT_READY):
            raise DriverError(f"cuStreamQuery: {getattr(code, 'name', code)}")
        return int(code) == NOT_READY

    def wait(self) -> None:
        while self.busy():
            time.sleep(PATIENCE)


#: Code of the driver for work that is not done, CUDA_ERROR_NOT_READY.
NOT_READY = 600


class DeviceCall:
    """A repeatable call of the runs of a batch on a GPU, which fills its arrays as a kernel of the processor does.

    ``given`` are arguments of :data:`nearharmonic.core.layout.RUN` by name.
    """

    def __init__(self, gpu: Gpu, kernel: MemberKernel, given: Mapping[str, Any]) -> None:
        if given["resumed"].size:
            raise bad_setting("device", "gpu", "runs from a start: a continued run has the bits of one on a processor")
        self.gpu, self.kernel, self.given = gpu, kernel, given
        self._look = given["stretch"] if given["measured"] == LOOKS else 1
        self._steps = FIRST  # of a launch

    def __call__(self) -> None:
        given, gpu, control = self.given, self.gpu, self.given["control"]
        gpu.enter()
        runs, samples = given["marks"].shape
        sets, columns = given["parameters"].shape
        numbers = numbers_of_a_run(given["start"].shape[1] // 4, columns, samples, sets > 1)
        size = runs_of_a_chunk(runs, sum(numbers.values()), gpu.free_memory())
        shapes: dict[str, tuple[int, ...]] = {name: (count, size) for name, count in numbers.items()}
        if sets == 1:
            shapes["parameters"] = (columns, 1)
        shapes |= {"moves": given["moves"].shape, "reference": (2,)}
        slots = [_Slot(gpu, shapes) for _ in range(min(2, ceil(runs / size)))]
        chunks = [slice(begin, min(begin + size, runs)) for begin in range(0, runs, size)]
        try:
            before: _Slot | None = None
            self._send(slots[0], chunks[0])
            for i in range(len(chunks)):
                slot = slots[i % 2]
                launches = self._launches(slot)
                next(launches, None)
                if before is not None:
                    self._receive(before)
                if i + 1 < len(chunks):
                    self._send(slots[(i + 1) % 2], chunks[i + 1])
                for _ in launches:
                    if control[STOP]:
                        return
                slot.copy(RETURNED, to_gpu=False)
                before = slot
            if before is not None:
                self._receive(before)
        finally:
            for slot in slots:
                slot.wait()
                slot.free()

    def _send(self, slot: _Slot, chunk: slice) -> None:
        given, slot.chunk = self.given, chunk
        count = chunk.stop - chunk.start
        for name in ("marks", "start", "parameters"):
            if name != "parameters" or len(given[name]) > 1:
                slot.host[name][:, :count] = given[name][chunk].T
            else:
                slot.host[name][:] = given[name].T
        slot.host["scheme"][0, :count] = given["scheme"][chunk]
        slot.host["moves"][:], slot.host["reference"][:] = given["moves"], given["reference"]
        slot.copy((*SENT, "moves", "reference"), to_gpu=True)
        for name in ("at", "mark"):
            self.gpu.call("cuMemsetD8Async", slot.device[name], 0, 8 * slot.host["scheme"].size, slot.stream)

    def _launches(self, slot: _Slot) -> Any:
        """Launch the kernel until all runs of a chunk are done; yield while a launch runs."""
        given, count = self.given, slot.chunk.stop - slot.chunk.start
        marks = given["marks"][slot.chunk].max(axis=1)
        longest, total, done = int(marks.max()), int(marks.sum()), 0
        function = self.gpu.function(self.kernel)
        while done < longest:
            steps = min(-(-self._steps // self._look) * self._look, longest - done)
            begin = time.monotonic()
            self._launch(function, slot, count, steps)
            yield
            slot.wait()
            self._steps = max(1, min(int(steps * LAUNCH / max(time.monotonic() - begin, 1e-4)), 8 * steps, 10**9))
            given["control"][PROGRESS] += total * steps // longest
            done += steps

    def _launch(self, function: Any, slot: _Slot, count: int, steps: int) -> None:
        given = self.given
        plain = {name: given[name] for name in ("measured", "stages", "kick_first")}
        plain |= {"first": 0, "count": count, "stride": slot.host["scheme"].size, "most": steps, "look": FAR}
        plain |= {"samples": given["marks"].shape[1], "parameter_sets": slot.host["parameters"].shape[1]}
        plain |= {name: float(given[name]) for name in ("limit", "scale")}
        if given["measured"] == LOOKS:
            plain["look"] = self._look
        values = list[Any]()
        for argument in MEMBER.arguments:
            values += [int(slot.device[argument.name]), 0] if argument.lengths else [plain[argument.name]]
        block = np.array([0 if isinstance(x, float) else int(x) for x in values], np.int64)
        doubles = block.view(np.float64)
        for i, x in enumerate(values):
            if isinstance(x, float):
                doubles[i] = x
        places = (ctypes.c_void_p * len(values))(*(block.ctypes.data + 8 * i for i in range(len(values))))
        grid = -(-count // BLOCK)
        self.gpu.call("cuLaunchKernel", function, grid, 1, 1, BLOCK, 1, 1, 0, slot.stream, ctypes.addressof(places), 0)

    def _receive(self, slot: _Slot) -> None:
        """Wait for a chunk, and put its results where they belong."""
        slot.wait()
        given, chunk, count = self.given, slot.chunk, slot.chunk.stop - slot.chunk.start
        _, samples, size = given["states"].shape
        for name in RETURNED:
            found = slot.host[name][:, :count]
            if name == "states":
                given[name][chunk] = found.reshape(samples, size, count).transpose(2, 0, 1)
            elif name == "left_at":
                given[name][chunk] = found[0]
            else:
                given[name][chunk] = found.T
