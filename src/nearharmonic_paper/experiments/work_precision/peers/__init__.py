"""Other libraries on the same systems and the same clock, one file a library, each used as its users use it.

A file defines ``PEERS``, the tuple of what it times. A new library is a new file and its name below. The files are
imported by name, not looked for in the folder: a digest of the code behind a result follows imports.
"""

from nearharmonic_paper.experiments.work_precision.peers import diffrax, gcc, heyoka, numpy, pyhamsys, rebound, scipy

#: Every peer by name, in the order of legends.
PEERS = {
    peer.name: peer for library in (scipy, heyoka, rebound, diffrax, pyhamsys, numpy, gcc) for peer in library.PEERS
}

#: Every library, as it is imported, and every compiler.
LIBRARIES = tuple(dict.fromkeys(peer.module for peer in PEERS.values()))
