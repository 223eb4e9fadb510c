"""Studies beyond the paper, a file each: their jobs call nearharmonic_studies."""


include: "studies/sixth_order.smk"
include: "studies/crystals.smk"
include: "studies/samplers.smk"
include: "studies/trained_search.smk"
include: "studies/trained.smk"
