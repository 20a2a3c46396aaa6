# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""All files of a diagnosis."""

from __future__ import annotations

from pathlib import Path

from wheel_terra_estimator.discrepancy.report.model_file import write_model, write_proposal
from wheel_terra_estimator.discrepancy.result import Diagnosis


def write_files(diagnosis: Diagnosis, folder: Path, *, pictures: bool) -> None:
    """Write ``report.json``, ``model.yaml``, ``proposal.yaml`` and, with pictures, the page."""
    diagnosis.write_json(folder / 'report.json')
    write_model(diagnosis, folder / 'model.yaml')
    if diagnosis.proposal:
        write_proposal(diagnosis, diagnosis.proposal, folder / 'proposal.yaml')
    if pictures:
        from wheel_terra_estimator.discrepancy.report.page import write_report

        write_report(diagnosis, folder)
