"""Damaged archives: every changed bit is found, no check hangs, and each fault is a sentence."""

import io
import json
import os
import random
import stat
from copy import copy
from hashlib import sha256
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

import pytest

from nearharmonic.errors import ResultFileError
from nearharmonic_paper.record import archive as check
from nearharmonic_paper.record import archive as pack
from nearharmonic_paper.record.archive import faults_of_archive
from support.results import finished_results

#: Enough to hit a stretch of 1/200 of the file that nothing protects with probability 1 - (199/200)**2000 = 1 - 4e-5.
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
        zipped.comment = check.BLANK
        for name, content in change(contents):
            zipped.writestr(name, content)
    check.close(place)


def replaced(name, content):
    return lambda contents: [(each, content if each == name else old) for each, old in contents]


@pytest.mark.slow
def test_a_flipped_bit_anywhere_is_found_and_told_in_one_line(place, whole):
    directory, seal = whole.index(b"PK\x01\x02"), len(whole) - len(check.BLANK) - 22
    unprotected = [*range(60), *range(directory, directory + 150), *range(seal, len(whole))]
    bits = [8 * byte + bit for byte in unprotected for bit in range(8)]
    for position in bits + random.Random(1).sample(range(8 * len(whole)), FLIPS):
        flipped = bytearray(whole)
        flipped[position // 8] ^= 1 << position % 8
        place.write_bytes(flipped)
        found = faults_of_archive(place)
        assert found, position
        assert not any("\n" in each for each in found)


def test_damage_to_a_file_names_the_file(place, whole):
    position = whole.index(b"HDF trajectories")
    place.write_bytes(whole[:position] + b"h" + whole[position + 1 :])
    damaged, *files = faults_of_archive(place)
    assert "is damaged: its bytes do not have the digest at its end" in damaged
    assert any(each.startswith("runs/kepler/ruth/0.h5") for each in files)


def foreign(_):
    buffer = io.BytesIO()
    with ZipFile(buffer, "w") as zipped:
        zipped.writestr("ro-crate-metadata.json", "{}")
    return buffer.getvalue()


@pytest.mark.parametrize(
    "damage",
    [
        *(lambda whole, keep=keep: whole[:keep] for keep in (0, 1, 100, -1, -200)),
        *(lambda whole, tail=tail: whole + tail for tail in (b"\0", b"more bytes")),
        lambda _: b"no zip file at all" * 20,
        foreign,
    ],
)
def test_truncated_extended_or_foreign_file_is_one_sentence(place, whole, damage):
    place.write_bytes(damage(whole))
    (found,) = faults_of_archive(place)
    assert "is not an archive of `nearharmonic archive`, or its end is missing or damaged" in found


def test_no_file_at_all_is_an_error(tmp_path):
    with pytest.raises(ResultFileError, match=r"none\.zip cannot be read: No such file"):
        faults_of_archive(tmp_path / "none.zip")


def undescribed(contents):
    """The contents without the page, which the description does not name any more, and without the preview."""
    for name, content in contents:
        if name == "ro-crate-preview.html":
            continue
        if name == "ro-crate-metadata.json":
            document = json.loads(content)
            document["@graph"] = [each for each in document["@graph"] if each["@id"] != "report.html"]
            yield name, json.dumps(document)
        elif name != "report.html":
            yield name, content


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            replaced("cubes/sho.h5", b"other"),
            [
                "cubes/sho.h5 in little.zip does not have the size and the digest that ro-crate-metadata.json gives",
                "cubes/sho.h5 does not have the size and the digest that manifest.json gives",
            ],
        ),
        (
            lambda contents: [each for each in contents if each[0] != "report.html"],
            ["report.html is missing from little.zip", "report.html is in manifest.json but not in the archive"],
        ),
        (
            replaced("ro-crate-preview.html", b"<!DOCTYPE html><title>other</title>"),
            ["ro-crate-preview.html in little.zip does not show ro-crate-metadata.json"],
        ),
        (
            replaced("ro-crate-preview.html", b'<script type="application/ld+json">{"@graph": []}</script>'),
            ["ro-crate-preview.html in little.zip does not show ro-crate-metadata.json"],
        ),
        (undescribed, ["report.html is in manifest.json but not in the archive"]),
        (
            lambda contents: [*contents, ("tables/\n\x1b[2J.csv", b"1\n")],
            [r"tables/\n\u001b[2J.csv is no plain path inside of the archive"],
        ),
        (
            lambda contents: [*contents, ("tables/more.csv", b"1\n")],
            ["tables/more.csv in little.zip is not described in ro-crate-metadata.json"],
        ),
        (lambda contents: [*contents, ("LICENSE", b"none")], ["LICENSE is in the archive 2 times"]),
    ],
    ids=[
        "changed", "missing", "preview without metadata", "preview of others", "undescribed", "escape sequence",
        "extra", "twice",
    ],
)  # fmt: skip
def test_fault_is_found_under_a_seal_that_is_right(place, change, says):
    sealed_again(place, change)
    assert faults_of_archive(place) == says


def test_compressed_members_are_not_ours(place):
    sealed_again(place, lambda contents: contents, ZIP_DEFLATED)
    assert all("is compressed: the members" in each for each in faults_of_archive(place))


def described(name, mode=0o100644):
    """A member that the metadata describe, under a name and with a mode that ``nearharmonic archive`` never writes."""

    def change(contents):
        content = b"/etc/passwd"
        entity = {"@id": name, "@type": "File", "contentSize": "11", "sha256": sha256(content).hexdigest()}
        for each, old in contents:
            if each == "ro-crate-metadata.json":
                document = json.loads(old)
                yield each, json.dumps({"@graph": [*document["@graph"], entity]})
            elif each != "ro-crate-preview.html":  # archives of earlier versions have none
                yield each, old
        member = ZipInfo(name)
        member.external_attr = mode << 16
        yield member, content

    return change


@pytest.mark.parametrize(
    "name", ["../../evil.txt", "/etc/evil", "a/./b", "a//b", "folder/", "..", "C:/x", "a\\..\\b", "a\x1b[2J"]
)
def test_path_that_leaves_archive_is_one_sentence(place, name):
    sealed_again(place, described(name))
    shown = name.replace("\x1b", r"\u001b")
    assert faults_of_archive(place) == [f"{shown} is no plain path inside of the archive"]


@pytest.mark.parametrize(("mode", "says"), [(stat.S_IFLNK, "is a symbolic link"), (stat.S_IFIFO, "is no regular file")])
def test_link_or_pipe_in_archive_is_one_sentence(place, mode, says):
    sealed_again(place, described("tables/link", mode | 0o777))
    assert faults_of_archive(place) == [f"tables/link {says}"]


def test_plain_member_that_metadata_describe_is_no_fault(place):
    sealed_again(place, described("tables/more.csv"))
    assert faults_of_archive(place) == []


def test_members_that_share_bytes_are_found_before_they_are_read(place):
    """A directory of 200 entries for the same bytes: what is read is far larger than the file."""
    with ZipFile(place, "w") as zipped:
        zipped.comment = check.BLANK
        zipped.writestr("0", bytes(100_000))
        first = zipped.infolist()[0]
        for number in range(1, 200):
            again = copy(first)
            again.filename = again.orig_filename = str(number)
            zipped.filelist.append(again)
    check.close(place)
    (found,) = faults_of_archive(place)
    assert found == "members of the archive overlap: together they are larger than its file"


def test_pipe_in_place_of_archive_is_one_sentence(tmp_path):
    os.mkfifo(tmp_path / "pipe.zip")
    with pytest.raises(ResultFileError, match=r"pipe\.zip cannot be read: not a regular file"):
        faults_of_archive(tmp_path / "pipe.zip")


@pytest.mark.parametrize("name", ["ro-crate-metadata.json", "manifest.json"])
@pytest.mark.parametrize(
    "content", [b"", b"[]", b"{}", b"\xff", b'{"@graph": [{"@type": "File", "@id": 1}], "files": 1}']
)
def test_verify_finds_empty_description_under_right_seal(place, name, content):
    sealed_again(place, replaced(name, content))
    assert faults_of_archive(place)
