"""A driver of a GPU that records its calls; memory belongs to the process, and a launch runs native code.

It has the functions of ``cuda.bindings.driver`` that :mod:`nearharmonic.engine.device` calls.
"""

import ctypes
from enum import IntEnum
from types import SimpleNamespace

import numpy as np

from nearharmonic.core.layout import MEMBER

SCALARS = {"int64": ctypes.c_int64, "float64": ctypes.c_double, "bool": ctypes.c_bool}
#: Types of the arguments of a launch, in C.
KINDS = [
    kind
    for argument in MEMBER.arguments
    for kind in ([ctypes.c_void_p, ctypes.c_int64] if argument.lengths else [SCALARS[argument.scalar]])
]


class Code(IntEnum):
    CUDA_SUCCESS = 0
    CUDA_ERROR_NO_DEVICE = 100


class RecordedDriver:
    """``calls`` has the name and the arguments of each call; ``memory`` the arrays that are not freed."""

    CUdevice_attribute = SimpleNamespace(
        CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR="major",
        CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MINOR="minor",
        CU_DEVICE_ATTRIBUTE_SINGLE_TO_DOUBLE_PRECISION_PERF_RATIO="ratio",
    )

    def __init__(self, free=10**9, major=9, ratio=2, devices=1):
        self.free, self.devices = free, devices
        self.attributes = {"major": major, "minor": 0, "ratio": ratio}
        self.calls, self.memory, self.kernels, self.streams = [], {}, {}, set()

    def __getattr__(self, name):
        if not name.startswith("cu"):
            raise AttributeError(name)

        def call(*given):
            self.calls.append((name, given))
            found = getattr(self, f"_{name}", lambda *_: ())(*given)
            return found if isinstance(found, tuple) and found and isinstance(found[0], Code) else (Code(0), *found)

        return call

    def named(self, name):
        return [given for called, given in self.calls if called == name]

    def _cuInit(self, flags):
        return () if self.devices else (Code.CUDA_ERROR_NO_DEVICE,)

    def _cuDeviceGet(self, number):
        return (number,)

    def _cuDevicePrimaryCtxRetain(self, device):
        return ("context",)

    def _cuDeviceGetAttribute(self, kind, device):
        return (self.attributes[kind],)

    def _cuDeviceGetName(self, length, device):
        return (b"recorded",)

    def _cuMemGetInfo(self):
        return self.free, self.free

    def _cuMemAlloc(self, size):
        array = np.full(size, 0xA5, np.uint8)
        self.memory[array.ctypes.data] = array
        return (array.ctypes.data,)

    _cuMemAllocHost = _cuMemAlloc

    def _cuMemFree(self, place):
        del self.memory[place]
        return ()

    _cuMemFreeHost = _cuMemFree

    def _cuMemcpyHtoDAsync(self, to, source, size, stream):
        ctypes.memmove(to, source, size)
        return ()

    _cuMemcpyDtoHAsync = _cuMemcpyHtoDAsync

    def _cuMemsetD8Async(self, to, value, size, stream):
        ctypes.memset(to, value, size)
        return ()

    def _cuStreamCreate(self, flags):
        self.streams.add(len(self.calls))
        return (len(self.calls),)

    def _cuStreamDestroy(self, stream):
        self.streams.remove(stream)
        return ()

    def _cuModuleLoadData(self, place):
        return (ctypes.string_at(place).decode(),)

    def _cuModuleGetFunction(self, module, name):
        return (module,)

    def _cuLaunchKernel(self, function, *given):
        grid, block, arguments = given[0], given[3], given[8]
        places = (ctypes.c_void_p * len(KINDS)).from_address(arguments)
        first, *others = (kind.from_address(place).value for kind, place in zip(KINDS, places, strict=True))
        run = ctypes.CFUNCTYPE(None, *KINDS)(self.kernels[function].place)
        for thread in range(grid * block):
            run(first + thread, *others)
        return ()
