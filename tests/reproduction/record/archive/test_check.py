"""A damaged archive: every change of a bit is found, nothing hangs, and what is wrong is told in sentences."""

from __future__ import annotations

import io
import json
import random
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import pytest

from nearharmonic.errors import ResultFileError
from nearharmonic.reproduction.record.archive import pack, seal
from nearharmonic.reproduction.record.archive.check import faults_of_archive
from support.results import finished_results

#: Enough to hit a stretch of 1/200 of the file that nothing protects with probability 1 - (199/200)**4000 = 1 - 2e-9.
FLIPS = 2000


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of a small archive."""
    folder = tmp_path_factory.mktemp("archive")
    place = pack.save(finished_results.write_result(folder / "little"), folder / "little.zip", with_runs=True)
    assert faults_of_archive(place) == []
    return place.read_bytes()


@pytest.fixture
def place(tmp_path, whole):
    """A copy of the archive that a test may damage."""
    copy = tmp_path / "little.zip"
    copy.write_bytes(whole)
    return copy


def sealed_again(place, change, compression=ZIP_STORED):
    """Write the archive anew with its contents changed by ``change``, under a seal that is right."""
    with ZipFile(place) as zipped:
        contents = [(name, zipped.read(name)) for name in zipped.namelist()]
    with ZipFile(place, "w", compression) as zipped:
        zipped.comment = seal.BLANK
        for name, content in change(contents):
            zipped.writestr(name, content)
    seal.close(place)


def replaced(name, content):
    return lambda contents: [(each, content if each == name else old) for each, old in contents]


def test_a_flipped_bit_anywhere_is_found(place, whole):
    for bit in random.Random(1).sample(range(8 * len(whole)), FLIPS):
        byte = bit // 8
        place.write_bytes(whole[:byte] + bytes([whole[byte] ^ 1 << bit % 8]) + whole[byte + 1 :])
        assert faults_of_archive(place), bit


@pytest.mark.parametrize("part", ["first header", "directory", "seal"])
def test_every_unprotected_zip_bit_is_reported_in_one_line(tmp_path, whole, part):
    place = tmp_path / "flipped.zip"
    directory = whole.index(b"PK\x01\x02")
    spans = {
        "first header": range(60), "directory": range(directory, directory + 150),
        "seal": range(len(whole) - len(seal.BLANK) - 22, len(whole)),
    }  # fmt: skip
    for position in spans[part]:
        for bit in range(8):
            flipped = bytearray(whole)
            flipped[position] ^= 1 << bit
            place.write_bytes(flipped)
            found = faults_of_archive(place)
            assert found, (position, bit)
            assert all(isinstance(each, str) and "\n" not in each for each in found)


def test_damage_to_a_file_names_the_file(place, whole):
    position = whole.index(b"HDF trajectories")
    place.write_bytes(whole[:position] + b"h" + whole[position + 1 :])
    damaged, *files = faults_of_archive(place)
    assert "is damaged: its bytes do not have the digest at its end" in damaged
    assert any(each.startswith("runs/kepler/ruth/0.h5") for each in files)


@pytest.mark.parametrize("keep", [0, 1, 100, -1, -200])
def test_a_truncated_archive_is_one_sentence(place, whole, keep):
    place.write_bytes(whole[:keep])
    (found,) = faults_of_archive(place)
    assert "is not an archive of `nearharmonic archive`, or its end is missing or damaged" in found


@pytest.mark.parametrize("tail", [b"\0", b"more bytes"])
def test_bytes_after_the_seal_are_found(place, whole, tail):
    place.write_bytes(whole + tail)
    (found,) = faults_of_archive(place)
    assert "its end is missing or damaged" in found


def test_a_foreign_zip_file_is_one_sentence(place):
    buffer = io.BytesIO()
    with ZipFile(buffer, "w") as zipped:
        zipped.writestr("ro-crate-metadata.json", "{}")
    for content in (buffer.getvalue(), b"no zip file at all" * 20):
        place.write_bytes(content)
        (found,) = faults_of_archive(place)
        assert "is not an archive of `nearharmonic archive`" in found


def test_seal_on_what_is_no_zip_file_is_one_sentence(place):
    place.write_bytes(b"no zip file" + seal.BLANK)
    seal.close(place)
    (found,) = faults_of_archive(place)
    assert "cannot be read" in found


def test_no_file_at_all_is_an_error(tmp_path):
    with pytest.raises(ResultFileError, match=r"none\.zip cannot be read: No such file"):
        faults_of_archive(tmp_path / "none.zip")


def test_verify_finds_changed_bytes_under_right_seal(place):
    sealed_again(place, replaced("cubes/sho.h5", b"other"))
    assert faults_of_archive(place) == [
        "cubes/sho.h5 in little.zip does not have the size and the digest that ro-crate-metadata.json gives",
        "cubes/sho.h5 does not have the size and the digest that manifest.json gives",
    ]


def test_missing_file_is_found_under_seal_that_is_right(place):
    sealed_again(place, lambda contents: [each for each in contents if each[0] != "report.html"])
    assert faults_of_archive(place) == [
        "report.html is missing from little.zip",
        "report.html is in manifest.json but not in the archive",
    ]


def test_missing_file_that_nothing_describes_is_found_in_manifest(place):
    def without_page(contents):
        for name, content in contents:
            if name == "ro-crate-metadata.json":
                document = json.loads(content)
                document["@graph"] = [each for each in document["@graph"] if each["@id"] != "report.html"]
                yield name, json.dumps(document)
            elif name != "report.html":
                yield name, content

    sealed_again(place, without_page)
    assert faults_of_archive(place) == ["report.html is in manifest.json but not in the archive"]


def test_extra_file_is_found_under_seal_that_is_right(place):
    sealed_again(place, lambda contents: [*contents, ("tables/extra.csv", b"1\n")])
    assert faults_of_archive(place) == ["tables/extra.csv in little.zip is not described in ro-crate-metadata.json"]


def test_name_with_line_end_is_told_in_one_line(place):
    sealed_again(place, lambda contents: [*contents, ("tables/\n\x1b[2J.csv", b"1\n")])
    (found,) = faults_of_archive(place)
    assert found.startswith(r"tables/\n\x1b[2J.csv in little.zip")


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_verify_finds_duplicate_file_under_right_seal(place):
    sealed_again(place, lambda contents: [*contents, ("LICENSE", b"none")])
    assert "LICENSE is in little.zip 2 times" in faults_of_archive(place)


def test_compressed_members_are_not_ours(place):
    sealed_again(place, lambda contents: contents, ZIP_DEFLATED)
    assert faults_of_archive(place)


@pytest.mark.parametrize("name", ["ro-crate-metadata.json", "manifest.json"])
@pytest.mark.parametrize(
    "content", [b"", b"[]", b"{}", b"\xff", b'{"@graph": [{"@type": "File", "@id": 1}], "files": 1}']
)
def test_verify_finds_empty_description_under_right_seal(place, name, content):
    sealed_again(place, replaced(name, content))
    assert faults_of_archive(place)
