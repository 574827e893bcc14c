# SPDX-License-Identifier: Apache-2.0
"""From a run, or its recording, to metrics, figures and a report."""
