"""Colour and marker of each method, separate from matplotlib, which is slow to load.

Methods differ in colour, and in marker and filling, for grey print and colour-blind readers. Methods of Nielsen (2015)
have filled markers, and other methods of that paper have hollow markers. Dashes are free for other distinctions in a
figure (extended precision, composition).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from zlib import crc32


@dataclass(frozen=True)
class Style:
    """Colour and marker of one method in all figures."""

    colour: str
    marker: str
    filled: bool = False

    def line(self, **changes: Any) -> dict[str, Any]:
        """Keywords of ``Axes.plot`` for a curve of this method, with changes."""
        face = self.colour if self.filled else "white"
        return {"color": self.colour, "marker": self.marker, "markerfacecolor": face} | changes

    def points(self, **changes: Any) -> dict[str, Any]:
        """Keywords of ``Axes.plot`` for markers without a line."""
        return self.line(linestyle="none") | changes


# The colours were found by a search: they have a contrast of at least 3:1 with white, and any two differ by 13 CIELAB
# units for readers with deuteranopia, protanopia or tritanopia (Machado et al. 2009, doi:10.1109/TVCG.2009.113).
_STYLES = {
    "ruth": Style("#6b6b6b", "o"),
    "s5odr4": Style("#806515", "s"),
    "aba104": Style("#00a070", "^"),
    "aba864": Style("#4a90e2", "D"),
    "aba1064": Style("#8e3fb5", "v"),
    "yoshida_s7o6a": Style("#e0569b", "p"),
    "abas5o6h": Style("#e86a10", "o", filled=True),
    "babs7o7h": Style("#0b3c8c", "s", filled=True),
    "babps8o7h": Style("#8b0000", "^", filled=True),
    "babps9o7h": Style("#000000", "D", filled=True),
    # Other methods of Nielsen's Table 4, which are not in the figures of the paper.
    "abas5o6h_b": Style("#8a4b08", "P", filled=True),
    "abas5o6h_c": Style("#c1440e", "X", filled=True),
    "babs6o7h": Style("#2b5fa5", "P", filled=True),
    "babs6o5h": Style("#14746f", "X", filled=True),
    "babps6o5h": Style("#9d174d", "P", filled=True),
    "babps7o6h": Style("#5b21b6", "X", filled=True),
}
#: Methods that are not in the paper: a colour for the methods of a source or a kind, and a marker for each method.
_OTHERS = (
    ("#707070", "<", "leapfrog"),
    ("#3a3a9c", "<>h*", "blanes_moan_s6o4 srkn_b6 srkn_b11 srkn_a14"),
    ("#1f7a7a", "<>h*8d", "mclachlan_s4 mclachlan_s5 mclachlan_sb3a4 mclachlan_sb3a5 mclachlan_ss5 mclachlan_atela_2"),
    ("#a0408f", "<>h*8d", "pefrl vefrl efrl omelyan_p5 omelyan_v5 omelyan_s7o6"),
    ("#2e6e2e", "<>h", "s9odr6a s15odr8 s17odr8a"),
    ("#b91c1c", "d", "nystrom_6a8"),
    ("#00798c", "<>", "na7 rnia12"),
    ("#1d6fb8", "<>h*8d", "srkn_a17 srkn_a18 srkn_a19 srkn_b17 srkn_b18 srkn_b19"),
    ("#a8480c", "<>h*", "teloy_6a9 teloy_8a17a teloy_8a17b teloy_8a17c"),
    ("#6d3fa8", "<>h", "sofspa_s11o6 sofspa_s19o8 sofspa_s35o10"),
    ("#3f7d20", "*", "morales_s17o8"),
    ("#6b6b6b", "<", "ruth_s3o3"),
    ("#5f8a3a", "<>h", "mclachlan_atela_3 mclachlan_atela_4 mclachlan_atela_5"),
    ("#8a6200", "<>d", "bcss_s3 bcss_s4 predescu_s3"),
    # With kicks of a modified potential.
    ("#332288", ">", "omelyan_g5o6"),
    ("#117733", "h", "rowlands"),
    # Trained on ensembles: from large to small errors, then methods for other problems.
    (
        "#d6006e",
        "<>h*8dp",
        "trained_coarse trained_light trained_moderate trained_fine trained_finer trained_finest trained_precise",
    ),
    ("#7a3b69", "<>h*", "trained_weak trained_orbits trained_orbits_coarse trained_modified"),
)
_STYLES |= {
    name: Style(colour, marker)
    for colour, markers, names in _OTHERS
    for name, marker in zip(names.split(), markers, strict=True)
}

_SPARE_COLOURS = ("#2a8f80", "#8a8a2e", "#332288", "#aa4499", "#cc6677", "#117733", "#5d5d5d")
_SPARE_MARKERS = ("<", ">", "*", "h", "d", "8")


def style_of(integrator: str) -> Style:
    """Return the style of a method; a method without an entry in the table gets one from a hash of its name."""
    if integrator in _STYLES:
        return _STYLES[integrator]
    rest, colour = divmod(crc32(integrator.encode()), len(_SPARE_COLOURS))
    rest, marker = divmod(rest, len(_SPARE_MARKERS))
    return Style(_SPARE_COLOURS[colour], _SPARE_MARKERS[marker], filled=rest % 2 == 1)
