"""Methods with kicks of a modified potential, trained on near-harmonic systems.

Coefficients of symmetric compositions that make the energy error of an ensemble of problems small over a window of step
sizes, and meet their order conditions exactly: the experiment ``trained`` has the search, docs/trained.md what they are
worth. Each note has the window in tau/s, in radians of the fastest oscillation, the ensemble, the limit of linear
stability, the seed, and the digest of the run that found the method.
"""

from nearharmonic.integrators.tableau import Tableau, palindrome

SOURCE = (
    "trained by nearharmonic (experiments.trained, docs/trained.md); searches began with published methods, those of "
    "Blanes & Moan (2002), J. Comput. Appl. Math. 142, 313, doi:10.1016/S0377-0427(01)00492-7, among them"
)

TABLEAUS = (
    Tableau(
        name="trained_modified",
        label="trained modified",
        order=4,
        first="drift",
        kick=palindrome(
            "0.15947779425145083933232686002424465740944454574202966557170758",
            "0.25634016999442094081540125507055036728480598591647365822296715",
            "0.08418203575412821985227188490520497530574946834149667620532528",
        ),
        square=palindrome(
            "0.00057421967299895943687795007795283382083856075307487956641392",
            "0.00345524368597517506650853313734795520222381263276695720313267",
            "-0.00099975749464741006437194215303453674632489175299048908592983",
        ),
        drift=palindrome(
            "0.06390863231182137924481800631489650512500528927012748973673057",
            "0.27913980834363516425239243932335257557054417464192641178328766",
            "-0.08732521186177844041449533306224085142235308617937547991570564",
            centre="0.48855354241264379383456977484798354145360724453464315679137483",
        ),
        source=SOURCE,
        digits=60,
        note=(
            "planetary orbits, kicks of a modified potential: tau/s 0.0419 to 0.0838; "
            "Kepler orbits, e 0.02 to 0.35; seed 1; run 67d4f40d77af3f2a"
        ),
    ),
)
