"""Descriptions of an archive: RO-Crate metadata, their preview, a README, and metadata for Zenodo."""
