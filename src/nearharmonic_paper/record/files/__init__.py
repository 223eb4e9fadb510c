"""Files of a result and of its record: manifest, fingerprint of the code, folders, texts."""
