# SPDX-License-Identifier: Apache-2.0
"""`python -m skydiver_utc`: the command line."""

from skydiver_utc.cli.main import main

main(prog_name="skydiver-utc")
