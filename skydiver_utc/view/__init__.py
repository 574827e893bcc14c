# SPDX-License-Identifier: Apache-2.0
"""Pages on which people see a run: the report, and the bodies in 3-D."""
