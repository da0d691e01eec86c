"""The folder of a diagnosis: JSON, extended model, report and pictures."""

from pathlib import Path

from afm_scan_ros.core.diagnosis.residual_report import ResidualReport
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.files.diagnosis_file import account_document, save_diagnosis
from afm_scan_ros.files.model_file import save_model
from afm_scan_ros.report.diagnosis_page import diagnosis_page, pictures
from afm_scan_ros.report.provenance import Provenance, heading_lines


def write_diagnosis(folder: Path, found: ResidualReport, heading: str, of: Provenance) -> None:
    """Write all files of a diagnosis; ``heading`` begins the comment at the head of the model's."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = pictures(found)
    save_diagnosis(folder / "diagnosis.json", {**account_document(found), "provenance": plain(of)})
    head = f"{heading}\n{heading_lines(of)}"
    save_model(folder / "model.extended.yaml", found.diagnosis.model, head)
    (folder / "report.html").write_text(diagnosis_page(found, drawn, of), "utf-8")
    for axis, content in drawn.items():
        (folder / f"residual_{axis}.png").write_bytes(content)
