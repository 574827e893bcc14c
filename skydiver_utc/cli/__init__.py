# SPDX-License-Identifier: Apache-2.0
"""The commands of ``skydiver-utc``, one module each; `main` imports a module only when its command is used."""
