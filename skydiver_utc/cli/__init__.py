# SPDX-License-Identifier: Apache-2.0
"""The commands of ``skydiver-utc``, one file each: options, help, and a body that imports what it needs."""
