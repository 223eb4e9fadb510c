"""Result files and datasets: the same bytes twice, named dimensions, plain words about broken files."""

import os
import shutil
import subprocess
import sys

import h5netcdf
import h5py
import numpy as np
import pytest
import xarray as xr

from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.output import store
from nearharmonic.output.store import Contents, assembled, coordinate, flags, name_of, variable
from nearharmonic_paper.tasks import job
from support.hostile.mutations import FOREIGN, make_foreign
from support.results.result_folder import edited


def described(dims, values, units="1", long_name="something"):
    return tuple(dims), values, {"units": units, "long_name": long_name}


@pytest.fixture
def variables():
    random = np.random.default_rng(1)
    return {
        "tau_per_stage": described(["tau_per_stage"], np.array([0.1, 0.2, 0.4]), "h", "step size per stage"),
        "q": described(["tau_per_stage", "sample", "component"], random.normal(size=(3, 500, 2)), "1e6 km", "position"),
        "steps": described(["tau_per_stage"], np.array([4, 2, 1]), "1", "steps"),
        "status": flags("tau_per_stage", ["ok", "ok", "diverged"], ("ok", "diverged"), "how the run ended"),
        "energy": described([], -0.5, "1", "energy"),
    }


def test_what_is_written_is_read_back_bit_for_bit(tmp_path, variables):
    path = tmp_path / "runs" / "0.h5"
    store.write(path, variables, {"code_digest": "abc", "count": 3})
    found = store.read(path)
    for name, (dims, values, attributes) in variables.items():
        assert found[name].dims == dims
        np.testing.assert_array_equal(found[name].values, values, strict=False)
        assert found[name].attrs == attributes
    assert (found.attrs["code_digest"], found.attrs["count"]) == ("abc", 3)


def test_h5py_and_xarray_both_see_named_dimensions(tmp_path, variables):
    store.write(tmp_path / "0.h5", variables, {}, {"extended": variables})
    with h5py.File(tmp_path / "0.h5") as file:
        for q in (file["q"], file["extended/q"]):
            names = [dimension[0].name.rpartition("/")[2] for dimension in q.dims]
            assert names == ["tau_per_stage", "sample", "component"]
    with xr.open_dataset(tmp_path / "0.h5", engine="h5netcdf") as dataset:
        assert dict(dataset.sizes) == {"tau_per_stage": 3, "sample": 500, "component": 2}
        assert set(dataset.coords) == {"tau_per_stage", "sample", "component"}


@pytest.mark.parametrize("group", [None, "extended"])
def test_the_reader_finds_what_xarray_finds_by_itself(tmp_path, variables, group):
    bare = {name: variable for name, variable in variables.items() if name != "tau_per_stage"}  # a dimension alone
    store.write(tmp_path / "0.h5", variables, {"count": 3}, {"extended": bare})
    found = store.read(tmp_path / "0.h5", group)
    with xr.open_dataset(tmp_path / "0.h5", engine="h5netcdf", group=group) as dataset:
        alike = [name for name in dataset.variables if name != "status"]
        xr.testing.assert_identical(found[alike].drop_attrs(deep=False), dataset[alike].load().drop_attrs(deep=False))


def test_words_are_flags_in_file_and_words_for_its_reader(tmp_path, variables):
    """CF conventions, section 3.5: integers, with the values that they may have and the meaning of each."""
    store.write(tmp_path / "0.h5", variables, {})
    with xr.open_dataset(tmp_path / "0.h5", engine="h5netcdf") as dataset:
        assert dataset.status.dtype == np.int8
        assert dataset.status.attrs["flag_values"].tolist() == [0, 1]
        assert dataset.status.attrs["flag_meanings"] == "ok diverged"
        assert dataset.status.values.tolist() == [0, 0, 1]
    assert store.read(tmp_path / "0.h5").status.values.tolist() == ["ok", "ok", "diverged"]


@pytest.mark.slow
def test_auxiliary_coordinates_come_back_as_coordinates(tmp_path, variables):
    variables["label"] = described(["tau_per_stage"], np.array(["a", "b", "c"]))
    variables["t"] = described(["tau_per_stage", "sample"], np.zeros((3, 500)))
    store.write(tmp_path / "0.h5", variables, {}, {"extended": variables}, coordinates=("label", "t"))
    for group in (None, "extended"):
        with xr.open_dataset(tmp_path / "0.h5", engine="h5netcdf", group=group) as dataset:
            assert {"label", "t"} < set(dataset.coords)
            assert {"label", "t"} < set(dataset.q.coords)
            assert set(dataset.steps.coords) == {"tau_per_stage", "label"}
    with xr.open_datatree(tmp_path / "0.h5", engine="h5netcdf") as tree:
        assert tree["extended"].q.shape == (3, 500, 2)


def test_the_same_numbers_give_the_same_bytes(tmp_path, variables, monkeypatch):
    store.write(tmp_path / "a.h5", variables, {"code": "x"}, {"extended": variables})
    monkeypatch.setattr("time.time", lambda: 4e9)
    store.write(tmp_path / "b.h5", variables, {"code": "x"}, {"extended": variables})
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_large_arrays_are_compressed_in_chunks_that_can_be_cached(tmp_path):
    cube = {
        "tau_per_stage": described(["tau_per_stage"], np.arange(1_000_000.0)),
        "error": described(["precision", "integrator", "tau_per_stage"], np.zeros((1, 2, 1_000_000))),
        "q": described(["run", "sample"], np.zeros((40, 10_000))),
        "steps": described(["run"], np.zeros(40)),
    }
    store.write(tmp_path / "cube.h5", cube, {})
    with h5py.File(tmp_path / "cube.h5") as file:
        assert file["error"].chunks == (1, 1, 125_000)  # eight of them, each below 2**17 doubles
        assert file["q"].chunks == (10, 10_000)  # 13 rows of 80 kB would fit into 1 MiB, and 10 make four equal chunks
        assert (file["q"].compression, file["q"].shuffle) == ("gzip", True)
        assert file["steps"].compression is None


@pytest.fixture
def large():
    random = np.random.default_rng(7)
    noise, ends = random.normal(size=(300, 500)), np.arange(500) >= random.integers(1, 500, (300, 1))
    return {
        "noise": described(["run", "sample"], noise),
        "padded": described(["run", "sample"], np.where(ends, np.nan, noise)),
        "smooth": described(["run", "sample"], np.broadcast_to(2.0 ** np.arange(-250, 250), (300, 500))),
        "counts": described(["run", "sample"], np.broadcast_to(np.arange(500) % 250, (300, 500))),
        "single": described(["sample", "run"], noise.T.astype("<f4")),
        "swapped": described(["run", "sample"], noise.astype(">f8")),
        "bytes": described(["sample", "place"], random.integers(-9, 9, (500, 900)).astype(np.int8)),
        "states": described(["run", "sample", "component"], random.normal(size=(300, 500, 2))),  # in three chunks
    }


def test_hdf5_reads_every_bit_of_large_arrays(tmp_path, large):
    store.write(tmp_path / "large.h5", large, {})
    with h5py.File(tmp_path / "large.h5") as file:
        for name, (_, values, _) in large.items():
            assert file[name].dtype == values.dtype
            assert file[name][()].tobytes() == np.ascontiguousarray(values).tobytes(), name
            assert (file[name].compression, file[name].shuffle) == ("gzip", True)


def test_noise_takes_no_more_than_its_bytes_and_what_repeats_takes_few(tmp_path, large):
    store.write(tmp_path / "large.h5", large, {})
    with h5py.File(tmp_path / "large.h5") as file:
        share = {name: file[name].id.get_storage_size() / file[name].nbytes for name in large}
    assert share["noise"] < 0.92  # the highest byte of a double repeats
    assert share["smooth"] < 0.135  # one byte of eight is stored as it is
    assert share["counts"] < 0.02  # no byte of an integer is noise
    assert share["padded"] < 0.7  # half of its numbers are missing


@pytest.mark.parametrize("values", [np.array([True]), np.array([1j]), np.zeros(1, "f2"), np.zeros(1, "m8[s]")])
def test_a_type_that_no_reader_accepts_is_refused(tmp_path, values):
    with pytest.raises(NearharmonicError, match=f"'good' has values of type {values.dtype}".replace("[", r"\[")):
        store.write(tmp_path / "0.h5", {"good": described(["run"], values)}, {})


def structure_of(path):
    """Attributes by object and name, but those that point to objects, and the order of members of each group."""
    found = {}

    def note(name, member):
        found[name] = list(member) if isinstance(member, h5py.Group) else (member.dtype, member.shape, member.maxshape)
        for key in {*member.attrs} - {"_NCProperties", "DIMENSION_LIST", "REFERENCE_LIST"}:
            value = np.asarray(member.attrs[key])
            found[name, key] = value.dtype, value.shape, value.tolist()

    with h5py.File(path) as file:
        note("/", file)
        file.visititems(note)
    return found


def test_files_have_the_structure_that_h5netcdf_gives_them(tmp_path, variables):
    del variables["status"]  # has other notes in a file
    variables |= {one: described([one], np.arange(n)) for one, n in (("sample", 500), ("component", 2))}
    names = {"format": store.FORMAT, "Conventions": "CF-1.11", "count": 3, "text": "é"}
    store.write(tmp_path / "ours.h5", variables, names, {"extended": variables})
    with h5netcdf.File(tmp_path / "theirs.h5", "w") as file:
        file.attrs.update(names)
        for group in (file, file.create_group("extended")):
            group.dimensions = {"tau_per_stage": 3, "sample": 500, "component": 2}
            for name, (dims, values, notes) in variables.items():
                group.create_variable(name, dims, data=np.asarray(values)).attrs.update(notes)
    ours, theirs = (structure_of(tmp_path / f"{name}.h5") for name in ("ours", "theirs"))
    for found in (ours, theirs):
        found["/"].remove("extended")  # it is made before or behind the variables
    assert ours == theirs


def test_a_group_has_dimensions_of_its_own(tmp_path, variables):
    shorter = {"tau_per_stage": described(["tau_per_stage"], np.array([0.1]), "h", "step size per stage")}
    store.write(tmp_path / "0.h5", variables, {}, {"extended": shorter})
    assert store.groups_of(tmp_path / "0.h5") == ("extended",)
    assert store.read(tmp_path / "0.h5", "extended").sizes == {"tau_per_stage": 1}
    assert store.read(tmp_path / "0.h5").sizes["tau_per_stage"] == 3


def test_variables_that_are_left_out_are_not_read(tmp_path, variables):
    store.write(tmp_path / "0.h5", variables, {"count": 3})
    found = store.read(tmp_path / "0.h5", leave_out=("q",))
    assert "q" not in found
    assert found.steps.values.tolist() == [4, 2, 1]
    assert found.attrs["count"] == 3


def test_provenance_of_a_file_is_that_of_its_job(tmp_path, variables):
    """A data set from another file has the provenance of that file, and contents may name any attribute."""
    places = [tmp_path / f"{number}.h5" for number in range(3)]
    store.write(places[0], variables, {"code_digest": "old", "more": 1})
    store.write_dataset(places[1], store.read(places[0]), {"code_digest": "new"})
    made = Contents(variables=variables, attributes={"code_digest": "old", "more": 1})
    job.write(made, places[2:], {"code_digest": "new"})
    for place in places[1:]:
        found = store.attributes_of(place)
        assert (found["code_digest"], found["more"]) == ("new", 1)


LOST = flags("tau_per_stage", ["ok", "lost", "ok"], ("ok", "diverged"), "how the run ended")


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda given: given["q"][2].pop("units"), "'q' has no units"),
        (lambda given: given["q"][2].pop("long_name"), "'q' has no long_name"),
        (lambda given: given.update(steps=described(["tau_per_stage"], np.arange(5))), "'steps' of shape"),
        (lambda given: given.update(status=LOST), "'status' has a value that is none of ok, diverged"),
    ],
)
def test_variables_that_no_reader_understands_are_refused_without_file(tmp_path, variables, spoil, says):
    spoil(variables)
    with pytest.raises(NearharmonicError, match=says):
        store.write(tmp_path / "0.h5", variables, {})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kept", [0.0, 0.01, 0.5, 0.99])
def test_truncated_file_is_named_with_command_that_makes_it_again(tmp_path, variables, kept, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = "results/paper/runs/sho/ruth/0.h5"
    store.write(path, variables, {})
    whole = (tmp_path / path).read_bytes()
    (tmp_path / path).write_bytes(whole[: int(kept * len(whole))])
    with pytest.raises(ResultFileError) as refusal:
        store.read(path)
    assert str(refusal.value) == f"{path} is truncated or no result file. Make it again: snakemake -j2 --force {path}"


def test_every_flipped_bit_is_found_before_the_file_is_opened(tmp_path, variables, monkeypatch):
    """Some flips of the structure make HDF5 loop for ever, others change what no checksum of a chunk covers."""
    path = tmp_path / "0.h5"
    store.write(path, variables, {"code_digest": "abc"}, {"extended": variables})
    whole = path.read_bytes()
    monkeypatch.setattr(h5py, "File", None)
    random = np.random.default_rng(1)
    ends = [*range(64), *range(len(whole) - 90, len(whole))]
    energy = np.asarray(variables["energy"][1], dtype="<f8").tobytes()
    kinds = [whole.index(part) for part in (b"OHDR", b"code_digest", b"abc", b"long_name", energy)]
    for place in [*ends, *kinds, *random.integers(len(whole), size=1500)]:
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(random.integers(8))
        path.write_bytes(damaged)
        says = r"0\.h5 is (damaged|truncated).* Make it again: snakemake -j2 --force"
        with pytest.raises(ResultFileError, match=says):
            store.read(path)


def test_a_file_of_another_format_is_named(tmp_path, variables, monkeypatch):
    monkeypatch.setattr(store, "FORMAT", "nearharmonic 99")
    store.write(tmp_path / "0.h5", variables, {})
    monkeypatch.undo()
    with pytest.raises(ResultFileError, match="has another format"):
        store.read(tmp_path / "0.h5")


@pytest.mark.parametrize("group", ["", pytest.param("extended/", marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", FOREIGN)
def test_sealed_file_with_foreign_member_is_refused_unread(tmp_path, variables, kind, group):
    """The pipe would block any reader that opens it; the digest is right, as anybody can write one."""
    os.mkfifo(tmp_path / "pipe")
    path = tmp_path / "0.h5"
    store.write(path, variables | {"evaluations": variables["steps"]}, {}, {"extended": variables})
    with edited(path) as file:
        make_foreign(file, f"{group}q", FOREIGN[kind], tmp_path / "pipe")
    for read in (store.read, store.read_precisions, store.attributes_of, store.groups_of):
        with pytest.raises(ResultFileError, match=rf"0\.h5 has /{group}q.*, which .*\. Make it again: snakemake -j2"):
            read(path)
    assert f"/{group}q" in store.foreign_in(path)


#: A C library in which no file can be locked, as on some network mounts.
WITHOUT_LOCKS = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
int flock(int file, int kind) { errno = ENOLCK; return -1; }
int fcntl(int file, int kind, ...) {
    va_list rest; va_start(rest, kind); void *given = va_arg(rest, void *); va_end(rest);
    if (kind == F_SETLK || kind == F_SETLKW) { errno = ENOLCK; return -1; }
    return ((int (*)(int, int, ...))dlsym(RTLD_NEXT, "fcntl"))(file, kind, given);
}
int fcntl64(int, int, ...) __attribute__((alias("fcntl")));
"""


#: A process that reads and records there.
READS = """
from pathlib import Path
from nearharmonic.errors import ResultFileError
from nearharmonic.output import store
from nearharmonic_paper.record import history
from nearharmonic_paper.record.workflow_run import lock
folder = Path("results/paper")
lock(folder)
history.append(folder, {"id": "a", "start": "", "config": {}})
print(history.runs_of(folder)[0]["id"])
try:
    print(store.read(folder / "cubes/sho.h5").steps.values.tolist())
except ResultFileError as error:
    print(error)
"""
REFUSAL = "results/paper/cubes/sho.h5 cannot be read: its file system has no locks. Set HDF5_USE_FILE_LOCKING=FALSE"


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler")
@pytest.mark.parametrize(
    ("variable", "answer"), [("", "[4, 2, 1]"), pytest.param("TRUE", REFUSAL, marks=pytest.mark.slow)]
)
def test_files_are_read_and_recorded_on_mount_without_locks(tmp_path, variables, variable, answer):
    """Without locks, no lock, so two runs at once are possible, and a warning says so."""
    (tmp_path / "locks.c").write_text(WITHOUT_LOCKS)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", "locks.so", "locks.c", "-ldl"], cwd=tmp_path, check=True)
    store.write(tmp_path / "results/paper/cubes/sho.h5", variables, {})
    environment = os.environ | {"LD_PRELOAD": str(tmp_path / "locks.so"), "HDF5_USE_FILE_LOCKING": variable}
    script = [sys.executable, "-c", READS]
    done = subprocess.run(script, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["a", answer]
    place = "results/paper/logs/lock: No locks available"
    assert done.stderr == f"nearharmonic: warning: no lock, so two runs at once are possible: {place}\n"


@pytest.mark.parametrize("odd", [h5py.Empty("<f8"), 1j, np.zeros(2, [("a", "<f8")]), np.void(b"x")])
def test_attribute_that_is_no_number_or_text_is_refused(tmp_path, variables, odd):
    store.write(tmp_path / "0.h5", variables, {})
    with edited(tmp_path / "0.h5") as file:
        file.attrs["settings"] = odd
    for read in (store.read, store.attributes_of):
        with pytest.raises(ResultFileError, match="cannot be read"):
            read(tmp_path / "0.h5")


def test_an_empty_array_is_kept(tmp_path):
    store.write(tmp_path / "0.h5", {"x": described(["sample"], np.empty(0))}, {})
    assert store.read(tmp_path / "0.h5").x.shape == (0,)


def test_a_missing_file_and_a_missing_group_are_named(tmp_path, variables):
    with pytest.raises(ResultFileError, match="does not exist"):
        store.attributes_of(tmp_path / "0.h5")
    store.write(tmp_path / "0.h5", variables, {})
    with pytest.raises(ResultFileError, match="no readable group 'extended'"):
        store.read(tmp_path / "0.h5", "extended")


def test_file_under_the_name_of_another_is_refused(tmp_path, variables):
    results = tmp_path / "results/paper"
    for name in ("cubes/kepler.h5", "runs/kepler/ruth/0.h5"):
        store.write(results / name, variables, {})
    for name, other in (("cubes/kepler.h5", "cubes/sho.h5"), ("runs/kepler/ruth/0.h5", "runs/kepler/ruth/1.h5")):
        shutil.copy(results / name, results / other)
        with pytest.raises(ResultFileError, match=rf"{other} says it is {name}\. Make it again: .*--force .*{other}$"):
            store.read(results / other)
        with pytest.raises(ResultFileError, match=f"{other} says it is {name}"):
            store.read_precisions(results / other)


def test_copies_outside_of_results_and_renamed_results_are_read(tmp_path, variables):
    store.write(tmp_path / "results/paper/cubes/kepler.h5", variables, {})
    shutil.copytree(tmp_path / "results/paper", tmp_path / "results/other name")
    shutil.copy(tmp_path / "results/paper/cubes/kepler.h5", tmp_path / "mine.h5")
    for name in ("results/other name/cubes/kepler.h5", "mine.h5"):
        assert store.attributes_of(tmp_path / name)["file"] == "cubes/kepler.h5"


def test_dataset_that_was_read_gets_name_of_its_new_file(tmp_path, variables):
    store.write(tmp_path / "results/paper/runs/kepler/ruth/0.h5", variables, {})
    cube = store.read(tmp_path / "results/paper/runs/kepler/ruth/0.h5")
    for place, name in (("results/paper/cubes/kepler.h5", "cubes/kepler.h5"), ("elsewhere.h5", None)):
        store.write_dataset(tmp_path / place, cube, {})
        assert store.attributes_of(tmp_path / place).get("file") == name


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("results/paper/runs/kepler/ruth/0.h5", "runs/kepler/ruth/0.h5"),
        ("/home/results/results/my paper/cubes/sho.h5", "cubes/sho.h5"),
        ("results/paper/runs/results/cubes/0.h5", "runs/results/cubes/0.h5"),  # a system of this name
        ("results/paper/logs/earlier/runs/kepler/ruth/0-17.h5", ""),
        ("results/kepler.h5", ""),
        ("cubes/kepler.h5", ""),
    ],
)
def test_name_begins_below_the_folder_of_results(path, name):
    assert name_of(path) == name


def test_full_disk_is_one_sentence_and_no_crash_at_exit(tmp_path):
    script = (
        "import resource, sys\n"
        "import numpy as np\n"
        "from nearharmonic.errors import FileWriteError\n"
        "from nearharmonic.output import store\n"
        "x = (('x',), np.arange(9000.0), {'units': '1', 'long_name': 'x'})\n"
        "for size in (0, 1, 512, 4096):\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))\n"
        "    try:\n"
        "        store.write(sys.argv[1], {'x': x}, {})\n"
        "    except FileWriteError as error:\n"
        "        sys.stderr.write(f'{error}\\n')\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))\n"
        "store.write(sys.argv[1], {'x': x}, {})\n"
    )
    place = tmp_path / "0.h5"
    done = subprocess.run([sys.executable, "-c", script, place], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, f"{place} cannot be written: File too large\n" * 4)
    assert [path.name for path in tmp_path.iterdir()] == ["0.h5"]
    assert store.read(place).x.size == 9000


# --- datasets put together from described variables equal datasets of xarray's own constructor ------------------------


VARIABLES = {
    "error": variable("x", np.array([1e-3, np.inf, np.nan]), "relative error"),
    "status": variable("x", np.array(["ok", "diverged", "ok"]), "status"),
    "left": variable("x", np.array([0, 7, 0]), "step"),
    "flags": variable(("x", "y"), np.ones((3, 2), dtype=bool), "flags"),
    "listed": variable("y", [1.5, 2.5], "a list"),
    "scalar": variable((), np.float64(0.25), "a number", "h"),
    "word": variable((), np.array(["ok"])[0], "a word"),
    "whole": variable((), 3, "an integer"),
    "instants": variable("y", np.array(["2015-01-07", "2016-01-07"], dtype="datetime64[D]"), "days"),
}
#: Of dimensions without a coordinate.
COUNTS = {"x": variable("x", np.arange(3), "number of the x"), "y": variable("y", np.arange(2), "number of the y")}
COORDINATES = [
    coordinate("x", np.array([0.3, 0.1, 0.2]), "step size", "h"), coordinate("x", np.array([3, 1, 2]), "count"),
    coordinate("x", ["b", "a", "c"], "name"), {"t": variable("x", np.array([0.0, 1.0, 2.0]), "time", "h")}, {},
]  # fmt: skip


def check_identical(found, expected):
    xr.testing.assert_identical(found, expected)
    assert found.sizes == expected.sizes
    assert set(found.coords) == set(expected.coords)
    assert {k: type(v) for k, v in found.variables.items()} == {k: type(v) for k, v in expected.variables.items()}
    assert {k: v.dtype for k, v in found.variables.items()} == {k: v.dtype for k, v in expected.variables.items()}
    assert {k: v.encoding for k, v in found.variables.items()} == {k: v.encoding for k, v in expected.variables.items()}
    assert set(found.indexes) == set(expected.indexes)
    for name, index in expected.indexes.items():
        assert found.indexes[name].identical(index)
        assert found.xindexes[name].equals(expected.xindexes[name])


@pytest.mark.filterwarnings("ignore:Converting non-nanosecond")
@pytest.mark.parametrize("coordinates", COORDINATES)
def test_an_assembled_dataset_is_the_one_that_xarray_constructs(coordinates):
    found = assembled({**VARIABLES, **coordinates}, list(coordinates), {"system": "sho"})
    counts = {name: count for name, count in COUNTS.items() if name not in coordinates}
    expected = xr.Dataset(VARIABLES, coords=coordinates | counts, attrs={"system": "sho"})
    check_identical(found, expected)
    check_identical(found.isel(x=slice(1, None)), expected.isel(x=slice(1, None)))


def test_variables_of_different_sizes_are_refused():
    with pytest.raises(ValueError, match="conflicting sizes"):
        assembled({"a": variable("x", np.zeros(3), ""), "b": variable("x", np.zeros(2), "")}, [], {})


def test_attributes_of_dataset_and_of_its_variables_are_its_own():
    attributes = {"system": "sho"}
    made = assembled({**VARIABLES, **COORDINATES[0]}, ["x"], attributes)
    made.attrs["system"] = made.error.attrs["units"] = made.x.attrs["units"] = "changed"
    assert attributes == {"system": "sho"}
    assert (VARIABLES["error"][2]["units"], COORDINATES[0]["x"][2]["units"]) == ("1", "h")


def test_results_of_one_shape_share_neither_values_nor_attributes():
    def one(x):
        q = variable("sample", [x, x], "position")
        return assembled({"t": variable("sample", [x, x], "time"), "q": q}, ["t"], {})

    first, second = one(1.0), one(2.0)
    first["q"].values[:] = 7.0
    first["t"].values[:] = 7.0
    for name in ("q", "t", "sample"):
        first[name].attrs["note"] = "of the first"
    first = first.assign_coords(sample=[5, 6])
    assert one(2.0).identical(second)
    assert one(1.0).q.values.tolist() == one(1.0).t.values.tolist() == [1.0, 1.0]
    assert one(1.0).sample.values.tolist() == [0, 1]
