"""Bits and speed of runs on a GPU: kernels are prepared here, and run on a machine that has numpy and a driver alone.

``python benchmarks/gpu.py prepare FOLDER`` writes the text of the kernels, starts, coefficients, and digests of the
results of this processor: every registered explicit method on the paper's systems and on two others, for 10 000 random
members and 1 000 steps (minutes, below 40 MB). ``python benchmarks/gpu.py run FOLDER`` compares the bits on the GPU,
times each kernel and 1e9 Henon-Heiles trajectories of 1 000 force evaluations, and writes ``FOLDER/found.json``, in six
minutes at most; beside it all cores of the same machine, if this package is there. ``python benchmarks/gpu.py table``
assembles the kernels with ``ptxas``: registers, spills, instructions.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import re
import shutil
import subprocess
import tempfile
import time
from hashlib import sha256
from pathlib import Path

import numpy as np

MEMBERS, STEPS, SEED = 10_000, 1_000, 51
#: Largest trajectories at once, all of the main measurement, and force evaluations of each.
TOGETHER, ALL, EVALUATIONS = 2**22, 10**9, 1_000
BLOCK = 128
#: Kernels of the table and of the timings: system and arithmetic.
ARITHMETIC = {
    "plain": {"extended": False, "compensated": False},
    "compensated": {"extended": False, "compensated": True},
    "double-double": {"extended": True, "compensated": True},
}
#: Arrays of results, of which digests are compared.
RESULTS = ("states", "energy_error", "worst", "total", "energy", "left_at")
#: Published trajectories a second of 1 000 fixed steps of Tsit5 in float32 on a V100, Utkarsh et al. (2024),
#: doi:10.1016/j.cma.2023.116591; six evaluations a step, rounded to float32, no energy, no compensation.
PUBLISHED = {"DiffEqGPU (V100, float32)": 5.8e7, "MPGOS (V100, float32)": 8.9e7}


def digest(arrays):
    """SHA-256 of arrays by name; a NaN is one number, whatever its bits."""
    found = sha256()
    for name in RESULTS:
        array = np.ascontiguousarray(arrays[name])
        if array.dtype == np.float64:
            array = np.where(np.isnan(array), np.nan, array)
        found.update(array.tobytes())
    return found.hexdigest()


# --- Preparation, with this package.


def pendulums(q, k):
    """Two pendulums with a spring between them, a user's system with sines."""
    from nearharmonic.math import cos

    return -cos(q[0]) - cos(q[1]) + k * (q[0] - q[1]) ** 2 / 2


def galaxy(q, b):
    """A logarithmic galaxy, a user's system with a logarithm."""
    from nearharmonic.math import log

    return log(1 + q[0] ** 2 + q[1] ** 2 / b**2) / 2


def problems():
    """Systems by name, with step size per stage, starts, and a relative spread of the parameters or 0."""
    import nearharmonic as nh

    def own(name, V, **more):
        return nh.System(name=name, V=V, q0=[0.3, 0.1], p0=[0, 0.2], t_end=100, **more)

    rng = np.random.default_rng(SEED)
    near = rng.normal(0, 0.15, (MEMBERS, 4))
    orbit = np.array([69.8, 0.0, 0.0, 0.14]) * rng.uniform(0.9, 1.1, (MEMBERS, 4))
    return {
        "sho": (nh.systems["sho"], 0.1, near[:, :2] * 4, 0.0),
        "henon_heiles": (nh.systems["henon_heiles"], 0.1, near, 0.0),
        "kepler": (nh.systems["kepler"], 20.0, orbit, 0.01),
        "pendulums": (own("pendulums", pendulums, parameters={"k": "0.3"}), 0.05, near * 4, 0.1),
        "galaxy": (own("galaxy", galaxy, parameters={"b": "0.8"}), 0.05, near * 3, 0.1),
    }


def arguments_of(system, method, numerics, tau, starts, spread):
    """(kernel, arguments of each part of the method, results of this processor), for steps of ``tau``."""
    from dataclasses import replace
    from fractions import Fraction

    from nearharmonic.engine.batch import prepared_batch, sample_marks, single_steps, surface_limit
    from nearharmonic.engine.device import member_kernel
    from nearharmonic.engine.numbers import moves_of, parameter_array
    from nearharmonic.engine.settings import Numerics

    d, count = system.dimension, len(starts)
    start = np.zeros((count, 4 * d))
    start[:, :d], start[:, 2 * d : 3 * d] = starts[:, :d], starts[:, d:]
    own = {
        name: float(value.value) * (1 + spread * np.linspace(-1, 1, count)) for name, value in system.parameters.items()
    }
    parameters = parameter_array(system, own if spread else {name: x[0] for name, x in own.items()})
    parts = method.compositions
    step = parts[0]
    order = [parts[1], step, parts[2]] if method.processed else [step]
    moves = moves_of(system, method, [Fraction(tau)], numerics)
    lengths = [part.stages + 2 for part in parts]
    columns = dict(zip(map(id, parts), np.split(moves, np.cumsum(lengths[:-1]), axis=1), strict=True))
    asked = replace(numerics, energy="samples") if method.processed else numerics
    kernels, given, found = [], [], []
    for part in order:
        marks = sample_marks(np.full(count, STEPS), 2) if part is step else single_steps(count)
        batch = prepared_batch(
            system, part, asked, marks=marks, scheme=np.zeros(count, np.int64), start=start.copy(),
            moves=np.ascontiguousarray(columns[id(part)]), parameters=parameters.copy(), own_frequencies=True,
        )  # fmt: skip
        batch.run()
        kernel = member_kernel(system, Numerics(**vars(asked)).compiled, **part.kernel_options)
        given.append({
            "measured": {"every": 0, "samples": 2}[asked.energy], "steps": int(marks[0, 1]), "stages": part.stages,
            "kick_first": bool(part.first_same_as_last), "limit": surface_limit(system, 0.0), "scale": 0.0,
            "moves": batch.moves.ravel().tolist(), "spread": spread,
        })  # fmt: skip
        filled = batch.filled
        found.append(digest({name: getattr(filled, name) for name in RESULTS}))
        kernels.append(kernel)
        start = filled.states[:, 1].copy()
    return kernels, given, found, parameters


def prepare(folder):
    import nearharmonic as nh
    from nearharmonic.core.layout import MEMBER
    from nearharmonic.engine.settings import Numerics

    folder.mkdir(parents=True, exist_ok=True)
    names, cases, arrays = {}, [], {}
    for name, (system, tau, starts, spread) in problems().items():
        arrays[f"start {name}"] = starts
        for method in nh.integrators.registered:
            tableau = nh.integrators[method]
            if tableau.implicit or method not in nh.integrators:
                continue
            for how in ("compensated",) if method not in ("ruth", "babps9o7h") else ARITHMETIC:
                numerics = Numerics(
                    precision="extended" if how == "double-double" else "double",
                    summation="plain" if how == "plain" else "compensated",
                )
                try:
                    kernels, parts, digests, parameters = arguments_of(
                        system, tableau, numerics, tau * tableau.stages, starts, spread
                    )
                except nh.NearharmonicError as error:
                    print(f"{name} {method} {how}: left out, {error}")
                    continue
                arrays[f"parameters {name}"] = parameters
                for part, kernel, expected in zip(parts, kernels, digests, strict=True):
                    file = f"{sha256(kernel.ptx.encode()).hexdigest()[:16]}.ptx"
                    if file not in names:
                        (folder / file).write_text(kernel.ptx, encoding="utf-8")
                        names[file] = {"system": name, "arithmetic": how, **counted(kernel.ptx)}
                    part |= {"kernel": file, "digest": expected}
                cases.append({"system": name, "method": method, "arithmetic": how, "parts": parts})
    np.savez_compressed(folder / "arrays.npz", **arrays)
    told = {
        "arguments": [[one.name, one.scalar, bool(one.lengths)] for one in MEMBER.arguments], "cases": cases,
        "kernels": names,
    }  # fmt: skip
    (folder / "cases.json").write_text(json.dumps(told), encoding="utf-8")
    size = sum(file.stat().st_size for file in folder.iterdir())
    print(f"{len(cases)} cases, {len(names)} kernels, {size / 1e6:.1f} MB in {folder}")


def counted(text):
    """Double-precision instructions of a kernel's text: in its stage loop, in the rest of its step loop, and in all.

    Backward branches mark loops. The stage loop is the one without another inside, the step loop the next
    around it. NaN where blocks of the loops are not in order, as for sines.
    """
    lines, places = text.splitlines(), {}
    for i, line in enumerate(lines):
        if found := re.match(r"(\$\w+):", line):
            places[found[1]] = i

    def doubles(begin, end):
        return sum(bool(re.search(r"\t(?:@\S+ )?(?:add|sub|mul|fma|div|sqrt)\.rn\.f64", x)) for x in lines[begin:end])

    ends = {}  # of loops, by their first line
    for i, line in enumerate(lines):
        found = re.search(r"\bbra\S*\s+(\$\w+);", line)
        if found and places[found[1]] < i and doubles(places[found[1]], i):
            ends[places[found[1]]] = i
    loops = sorted(ends.items())
    inner = [(a, b) for a, b in loops if not any(a < c and d <= b for c, d in loops)]
    if any(a < c < b < d for a, b in loops for c, d in loops) or len(inner) != 1:
        return {"stage": float("nan"), "step": float("nan"), "all": doubles(0, len(lines))}
    stage = inner[0]
    around = [loop for loop in loops if loop[0] < stage[0] and stage[1] < loop[1]]
    step = max(around, default=stage)
    return {"stage": doubles(*stage), "step": doubles(*step) - doubles(*stage), "all": doubles(0, len(lines))}


# --- On the machine with a GPU: the driver through ctypes, and nothing of this package.


class Driver:
    """Functions of the driver; a code other than 0 ends the program."""

    def __init__(self):
        self.library = ctypes.CDLL("libcuda.so.1")
        self.call("cuInit", 0)
        device, self.context = ctypes.c_int(), ctypes.c_void_p()
        self.call("cuDeviceGet", ctypes.byref(device), 0)
        self.device = device.value
        self.call("cuDevicePrimaryCtxRetain", ctypes.byref(self.context), device)
        self.call("cuCtxSetCurrent", self.context)

    def call(self, name, *given):
        code = getattr(self.library, name)(*given)
        if code:
            raise SystemExit(f"{name}: error {code} of the driver")

    def attribute(self, number):
        value = ctypes.c_int()
        self.call("cuDeviceGetAttribute", ctypes.byref(value), number, self.device)
        return value.value

    def about(self):
        name, version = ctypes.create_string_buffer(100), ctypes.c_int()
        self.call("cuDeviceGetName", name, 100, self.device)
        self.call("cuDriverGetVersion", ctypes.byref(version))
        return {
            "device": name.value.decode(), "driver": version.value, "clock MHz": self.attribute(13) / 1000,
            "multiprocessors": self.attribute(16), "capability": self.attribute(75) + self.attribute(76) / 10,
            "float over double": self.attribute(87),
        }  # fmt: skip

    def function(self, file):
        module, function = ctypes.c_void_p(), ctypes.c_void_p()
        self.call("cuModuleLoadData", ctypes.byref(module), file.read_bytes() + b"\0")
        self.call("cuModuleGetFunction", ctypes.byref(function), module, b"member")
        return function

    def registers_and_blocks(self, function):
        registers, blocks = ctypes.c_int(), ctypes.c_int()
        self.call("cuFuncGetAttribute", ctypes.byref(registers), 4, function)
        self.call(
            "cuOccupancyMaxActiveBlocksPerMultiprocessor", ctypes.byref(blocks), function, BLOCK, ctypes.c_size_t(0)
        )
        return registers.value, blocks.value

    def array(self, values):
        """Memory of the GPU with these numbers, or with so many bytes."""
        place = ctypes.c_uint64()
        size = max(8, values if isinstance(values, int) else values.nbytes)
        self.call("cuMemAlloc_v2", ctypes.byref(place), ctypes.c_size_t(size))
        if not isinstance(values, int):
            self.call("cuMemcpyHtoD_v2", place, ctypes.c_void_p(values.ctypes.data), ctypes.c_size_t(values.nbytes))
        return place

    def fetched(self, place, shape, kind):
        found = np.empty(shape, kind)
        self.call("cuMemcpyDtoH_v2", ctypes.c_void_p(found.ctypes.data), place, ctypes.c_size_t(found.nbytes))
        return found


class Arrays:
    """Arrays of runs of a system on the GPU, with starts (M, 4 d) and parameters (M or 1, 2 P)."""

    def __init__(self, driver, start, parameters, steps):
        self.driver, (self.runs, self.size) = driver, start.shape
        d, self.sets = self.size // 4, len(parameters)
        marks = np.repeat(np.array([[0], [steps]], np.int64), self.runs, axis=1)
        doubles = {
            "states": 2 * self.size, "energy_error": 2, "worst": 2, "total": 2, "energy": 2, "running": 5 * d,
            "left_at": 1, "work": 9 * d + 9 + max(1, parameters.shape[1]), "at": 1, "mark": 1,
        }  # fmt: skip
        given = {"marks": marks, "scheme": np.zeros(self.runs, np.int64), "start": start.T, "parameters": parameters.T}
        given["reference"] = np.full(2, np.nan)
        self.places = {name: driver.array(np.ascontiguousarray(x)) for name, x in given.items()}
        self.places |= {name: driver.array(8 * count * self.runs) for name, count in doubles.items()}

    def free(self):
        for place in self.places.values():
            self.driver.call("cuMemFree_v2", place)

    def restart(self):
        for name in ("at", "mark"):
            self.driver.call("cuMemsetD8_v2", self.places[name], ctypes.c_ubyte(0), ctypes.c_size_t(8 * self.runs))

    def launch(self, function, told, part, moves):
        plain = {
            "first": 0, "count": self.runs, "stride": self.runs, "most": part["steps"], "look": 2**62, "samples": 2,
            "parameter_sets": self.sets, **{k: part[k] for k in ("measured", "limit", "scale", "stages", "kick_first")},
        }  # fmt: skip
        slots = []
        for name, scalar, is_array in told["arguments"]:
            if is_array:
                slots += [(moves if name == "moves" else self.places[name]), ctypes.c_int64(0)]
            else:
                kind = {"int64": ctypes.c_int64, "float64": ctypes.c_double, "bool": ctypes.c_bool}[scalar]
                slots.append(kind(plain[name]))
        places = (ctypes.c_void_p * len(slots))(*(ctypes.addressof(slot) for slot in slots))
        grid = -(-self.runs // BLOCK)
        self.driver.call("cuLaunchKernel", function, grid, 1, 1, BLOCK, 1, 1, 0, None, places, None)

    def seconds(self, function, told, part, moves, repeats=1):
        """Shortest time of a launch."""
        times = []
        for _ in range(repeats):
            self.restart()
            self.driver.call("cuCtxSynchronize")
            begin = time.perf_counter()
            self.launch(function, told, part, moves)
            self.driver.call("cuCtxSynchronize")
            times.append(time.perf_counter() - begin)
        return min(times)

    def results(self):
        def fetch(name, *shape, kind=np.float64):
            return self.driver.fetched(self.places[name], (*shape, self.runs), kind)

        found = {name: fetch(name, 2).T for name in ("energy_error", "worst", "total", "energy")}
        found["states"] = fetch("states", 2, self.size).transpose(2, 0, 1)
        return found | {"left_at": fetch("left_at", 1, kind=np.int64)[0]}


def state_rows(starts):
    """Starts (M, 2 d) as rows of a kernel, (M, 4 d)."""
    d = starts.shape[1] // 2
    rows = np.zeros((len(starts), 4 * d))
    rows[:, :d], rows[:, 2 * d : 3 * d] = starts[:, :d], starts[:, d:]
    return rows


def run(folder, seconds):
    begin, told = time.monotonic(), json.loads((folder / "cases.json").read_text(encoding="utf-8"))
    held = np.load(folder / "arrays.npz")
    driver = Driver()
    found = {"about": driver.about(), "kernels": {}, "bits": {}, "published": PUBLISHED}
    print(json.dumps(found["about"]))
    functions = {name: driver.function(folder / name) for name in told["kernels"]}
    rate = found["about"]["multiprocessors"] * 64 * found["about"]["clock MHz"] * 1e6  # doubles an SM and clock
    main = next(
        case for case in told["cases"]
        if (case["system"], case["method"], case["arithmetic"]) == ("henon_heiles", "babps9o7h", "compensated")
    )  # fmt: skip
    found["all"] = everything(driver, functions, told, main, held)
    print(f"{ALL:.0e} trajectories of {EVALUATIONS} evaluations: {found['all']['seconds']:.2f} s of the device")
    if cores := on_all_cores(main, held):
        found["cores"] = cores
        print(json.dumps(cores))
    for name, about in told["kernels"].items():
        case = next(c for c in told["cases"] if any(part["kernel"] == name for part in c["parts"]))
        part = next(part for part in case["parts"] if part["kernel"] == name)
        found["kernels"][name] = about | timed(driver, functions[name], told, case, part, held, about, rate)
        print(f"{about['system']:13s} {about['arithmetic']:13s} {json.dumps(found['kernels'][name])}", flush=True)
    for case in told["cases"]:
        if time.monotonic() - begin > seconds:
            print(f"stopped after {seconds} s: {len(found['bits'])} of {len(told['cases'])} cases compared")
            break
        key = f"{case['system']} {case['method']} {case['arithmetic']}"
        found["bits"][key] = equal_bits(driver, functions, told, case, held)
        if not found["bits"][key]:
            print(f"{key}: other bits")
    equal = sum(found["bits"].values())
    print(f"bits equal in {equal} of {len(found['bits'])} cases, {time.monotonic() - begin:.0f} s")
    (folder / "found.json").write_text(json.dumps(found, indent=1), encoding="utf-8")


def everything(driver, functions, told, case, held):
    """Device time of all trajectories of the main measurement, energies measured at every step."""
    part = case["parts"][0] | {"steps": EVALUATIONS // case["parts"][0]["stages"]}
    starts = np.resize(state_rows(held["start henon_heiles"]), (TOGETHER, 8))
    arrays = Arrays(driver, starts, held["parameters henon_heiles"], part["steps"])
    moves = driver.array(np.array(part["moves"]))
    one = arrays.seconds(functions[part["kernel"]], told, part, moves, repeats=3)
    launches, begin = -(-ALL // TOGETHER), time.perf_counter()
    for _ in range(launches):
        arrays.restart()
        arrays.launch(functions[part["kernel"]], told, part, moves)
    driver.call("cuCtxSynchronize")
    took = (time.perf_counter() - begin) * ALL / (launches * TOGETHER)
    arrays.free()
    evaluations = part["steps"] * part["stages"]
    return {"seconds": took, "shortest launch": one, "evaluations": evaluations, "trajectories a second": ALL / took}


def on_all_cores(case, held):
    """Run 2**18 of the trajectories on the processor of this machine; nothing where this package is missing."""
    try:
        import nearharmonic as nh
    except ImportError:
        return {}
    starts = np.resize(held["start henon_heiles"], (2**18, 4))
    part = case["parts"][0]
    steps, threads = EVALUATIONS // part["stages"], len(os.sched_getaffinity(0))
    begin = time.perf_counter()
    nh.ensemble(
        "henon_heiles", case["method"], 0.1 * part["stages"], q0=starts[:, :2], p0=starts[:, 2:],
        t_end=f"{0.1 * part['stages'] * steps:.6g}", samples=1, threads=threads,
    )  # fmt: skip
    took = time.perf_counter() - begin
    return {"threads": threads, "trajectories a second": len(starts) / took}


def timed(driver, function, told, case, part, held, about, rate):
    """Nanoseconds an evaluation, trajectories a second, occupancy, and share of the rate of fused products."""
    runs = 2**20
    starts = np.resize(
        state_rows(held[f"start {case['system']}"]), (runs, 2 * held[f"start {case['system']}"].shape[1])
    )
    parameters = held[f"parameters {case['system']}"]
    if len(parameters) > 1:
        parameters = np.resize(parameters, (runs, parameters.shape[1]))
    part = part | {"steps": min(part["steps"], max(1, 200 // part["stages"]))}
    arrays = Arrays(driver, starts, parameters, part["steps"])
    moves = driver.array(np.array(part["moves"]))
    took = arrays.seconds(function, told, part, moves, repeats=3)
    arrays.free()
    evaluations = runs * part["steps"] * part["stages"]
    instructions = runs * part["steps"] * (about["stage"] * (part["stages"] - 1) + about["step"])
    registers, blocks = driver.registers_and_blocks(function)
    return {
        "ns an evaluation": 1e9 * took / evaluations, "trajectories a second": runs / took, "registers": registers,
        "occupancy": blocks * BLOCK / 2048, "share of the double rate": instructions / took / rate,
    }  # fmt: skip


def equal_bits(driver, functions, told, case, held):
    """True if all parts of a method have the digests of the processor."""
    start, parameters = state_rows(held[f"start {case['system']}"]), held[f"parameters {case['system']}"]
    same = True
    for part in case["parts"]:
        arrays = Arrays(driver, start, parameters, part["steps"])
        moves = driver.array(np.array(part["moves"]))
        arrays.seconds(functions[part["kernel"]], told, part, moves)
        results = arrays.results()
        arrays.free()
        driver.call("cuMemFree_v2", moves)
        same = same and digest(results) == part["digest"]
        start = np.ascontiguousarray(results["states"][:, 1])
    return same


# --- The table of what the assembler says.


def table():
    from nearharmonic.core.gpu import build_member
    from nearharmonic.engine.kernels import physics_of
    from nearharmonic.output.table import pipes

    ptxas, rows = shutil.which("ptxas"), []
    if ptxas is None:
        raise SystemExit("ptxas is not on the PATH: pip install nvidia-cuda-nvcc-cu12, in its folder cuda_nvcc/bin")
    for name, (system, *_) in problems().items():
        for how, arithmetic in ARITHMETIC.items():
            text = build_member(physics_of(system), **arithmetic).ptx
            with tempfile.TemporaryDirectory() as place:
                file = Path(place) / "kernel.ptx"
                file.write_text(text, encoding="utf-8")
                call = [ptxas, "-v", "-arch=sm_90", str(file), "-o", str(file.with_suffix(".cubin"))]
                said = subprocess.run(call, capture_output=True, text=True, check=True).stderr
            counts = counted(text)
            spills = sum(map(int, re.findall(r"(\d+) bytes spill", said)))
            registers = re.findall(r"Used (\d+) registers", said)[0]
            kinds = [
                len(re.findall(rf"\t{kind}\.rn\.f64", text)) for kind in ("fma", "(?:add|sub)", "mul", "(?:div|sqrt)")
            ]
            rows.append([name, how, registers, spills, counts["stage"], counts["step"], *kinds])
    header = ["system", "arithmetic", "registers", "spilled bytes", "a stage", "the rest of a step"]
    print("\n".join(pipes([*header, "fma", "add, sub", "mul", "div, sqrt"], rows, align="llr")))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("what", choices=("prepare", "run", "table"))
    parser.add_argument("folder", nargs="?", type=Path, default=Path("build/gpu"))
    parser.add_argument("--seconds", type=float, default=330, help="time after which no further case is compared")
    options = parser.parse_args()
    if options.what == "table":
        table()
    elif options.what == "prepare":
        prepare(options.folder)
    else:
        run(options.folder, options.seconds)


if __name__ == "__main__":
    main()
