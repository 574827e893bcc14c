# SPDX-License-Identifier: Apache-2.0
"""Exit codes of every command and node process."""

FAILED = 1  # the run did not reach its end, or a result is wrong
REFUSED = 2  # nothing was started: an argument, a setting or a file cannot be used
STOPPED = 130  # interrupted by Ctrl-C or SIGTERM
