"""Random changes of documents, texts and HDF5 files, such as an attacker or a broken program makes."""

import json
from copy import deepcopy

import h5py
import numpy as np

from nearharmonic.output.atomic import sealed

#: What stands in place of a value.
ODD = (
    None, True, False, -1, 0, 1, 10**30, 10**400, 0.5, -0.0, 1e308, float("nan"), float("inf"), "", "x", "x" * 5000,
    "1e999999999", "../x", "/etc/passwd", "-x", "a\x00b", "\x1b[2J", "\u202e", "\ud800", "٣", "evil.py", "evil.py:mine",
    "<script>", "$(touch ran)", [], [[]], {}, {"": None}, {"file": "evil.py"}, [None], ["x"], [1, "x"],
)  # fmt: skip
#: What stands in place of an attribute or a variable of an HDF5 file.
ODD_ATTRIBUTES = (
    0, -1.5, float("nan"), "", "x", "a\x00b"[:1], "\x1b[2J", "{}", "[]", "{", "null", '{"sweep": 1}',
    '{"sweep": {"system": 1}}', '{"definitions": {"systems": {"kepler": {"file": "evil.py"}}}}', '{"definitions": 1}',
    '{"definitions": {"systems": 1}}', "evil.py", np.arange(3), np.array([b"x", b"y"]), np.array(True),
)  # fmt: skip
#: Settings in an attribute that no job has.
ODD_SETTINGS = (
    "[" * 3000, "[]", "1", '{"sweep": 1}', '{"sweep": {}, "definitions": 1}', '{"a": ' * 900 + "1" + "}" * 900,
    '{"definitions": {"systems": {"kepler": 1}}}', '{"sweep": {"samples": [1]}}',
)  # fmt: skip
#: What stands in a text where it does not belong.
TOKENS = (
    b"[" * 3000, b"\x00", b"\xff\xfe", b"9" * 5000, b"&a [*a]", b"!!python/name:os.system ", b"e999999999", b"1/0",
    b"\r", b'"', b"\xd9\xa3",
)  # fmt: skip

#: Members that this package never writes, as values or makers of them: functions of an open file, a name, a shape, and
#: the path of another file.
FOREIGN = {
    "external link": lambda file, name, shape, other: h5py.ExternalLink(other, "x"),
    "soft link": lambda file, name, shape, other: h5py.SoftLink("/evaluations"),
    "dangling link": lambda file, name, shape, other: h5py.SoftLink("/nothing"),
    "external storage": lambda file, name, shape, other: file.create_dataset(
        name, shape, "<f8", external=[(other, 0, h5py.h5f.UNLIMITED)]
    ),
    "virtual": lambda file, name, shape, other: file.create_virtual_dataset(name, _virtual(shape, other)),
    "compound": lambda file, name, shape, other: np.zeros(shape, [("a", "<f8"), ("b", "<i4")]),
    "complex": lambda file, name, shape, other: np.zeros(shape, complex),
    "long double": lambda file, name, shape, other: np.zeros(shape, np.longdouble),
    "opaque": lambda file, name, shape, other: np.zeros(shape, "V7"),
    "references": lambda file, name, shape, other: file.create_dataset(name, shape, h5py.ref_dtype),
    "texts of one length": lambda file, name, shape, other: np.full(shape, b"ok"),
    "lists": lambda file, name, shape, other: file.create_dataset(name, shape, h5py.vlen_dtype("f8")),
    "empty": lambda file, name, shape, other: h5py.Empty("<f8"),
    "without values": lambda file, name, shape, other: file.create_dataset(name, (10**6,) * 3, "<f8", chunks=(9,) * 3),
    "other compression": lambda file, name, shape, other: file.create_dataset(name, shape, "<f8", compression="lzf"),
    "itself": lambda file, name, shape, other: file["/"],
    "type": lambda file, name, shape, other: np.dtype("<f8"),
    "group in a group": lambda file, name, shape, other: file.create_group(f"{name}/{name}"),
}


def _virtual(shape, other):
    layout = h5py.VirtualLayout(shape, "<f8", maxshape=(None,) * len(shape))
    layout[...] = h5py.VirtualSource(other, "x", shape, maxshape=(None,) * len(shape))[...]
    return layout


def make_foreign(file, name, make, other):
    """Put a member of :data:`FOREIGN`, or another value that ``make`` returns, in the place of a variable."""
    shape = file[name].shape
    del file[name]
    made = make(file, name, shape, str(other))
    if name not in file:
        file[name] = made


def nested(levels):
    """A list in a list, and so on."""
    found = []
    for _ in range(levels):
        found = [found]
    return found


def _places(value, path=()):
    """Paths of all members of a document."""
    members = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, member in members:
        yield (*path, key)
        yield from _places(member, (*path, key))


def mutated(document, random, deepest=800):
    """A copy of a document with one to three members replaced, removed, renamed or moved."""
    changed = deepcopy(document)
    for _ in range(random.choice((1, 1, 2, 3))):
        places = list(_places(changed))
        if not places:
            return changed
        *way, key = random.choice(places)
        parent = changed
        for step in way:
            parent = parent[step]
        kind = random.randrange(8)
        if kind == 0:
            del parent[key]
        elif kind == 1 and isinstance(parent, dict):
            parent[str(random.choice(ODD))] = parent.pop(key)
        elif kind == 2:
            other = changed
            for step in random.choice(places):
                other = other[step] if isinstance(other, list | dict) and step in _keys(other) else other
            parent[key] = deepcopy(other)
        elif kind == 3:
            parent[key] = nested(random.choice((20, 100, deepest)))
            return changed  # more levels than these could not be written
        else:
            parent[key] = deepcopy(random.choice(ODD))
    return changed


def _keys(value):
    return value if isinstance(value, dict) else range(len(value))


def resealed(document):
    """The text of a document with a seal that is right, if there can be one."""
    document = {key: value for key, value in document.items() if key != "sha256"}
    try:
        return json.dumps(sealed(document))
    except UnicodeEncodeError:
        return json.dumps(document | {"sha256": "0" * 64})
    except RecursionError:
        return "[" * 3000


def mutated_bytes(content, random):
    """A copy of some bytes with one to three of them flipped, cut out, doubled, or with others put between them."""
    for _ in range(random.choice((1, 1, 2, 3))):
        at, length = random.randrange(len(content) + 1), random.choice((1, 2, 10, 1000))
        kind = random.randrange(5)
        if kind == 0 and at < len(content):
            content = content[:at] + bytes([content[at] ^ 1 << random.randrange(8)]) + content[at + 1 :]
        elif kind == 1:
            content = content[:at]
        elif kind == 2:
            content = content[:at] + content[at + length :]
        elif kind == 3:
            content = content[: at + length] + content[at:]
        else:
            token = random.choice((*TOKENS, random.randbytes(length)))
            content = content[:at] + token + content[at:]
    return content


def change_file(file, random):
    """Change one or two members of an open HDF5 file: attributes, types, shapes, names, values."""
    for _ in range(random.choice((1, 2))):
        members = [file, *file.values()]
        member = random.choice([file, *members])
        names = [name for name in member.attrs if not name.isupper() and not name.startswith("_")]
        kind = random.randrange(5)
        if kind == 0 and names:
            del member.attrs[random.choice(names)]
        elif kind in {1, 2} and names:
            member.attrs[random.choice(names)] = random.choice(ODD_ATTRIBUTES)
        elif isinstance(member, h5py.Dataset) and not member.is_scale:
            name = member.name
            if kind == 3:
                del file[name]
            elif member.dtype.kind in "if" and member.size:
                member[...] = random.choice((0, -1, np.nan, np.inf)) if member.dtype.kind == "f" else -1
