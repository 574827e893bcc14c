"""What the verbs of ``skydiver-utc`` do, each imported by `skydiver_utc.cli` only when it is used."""
