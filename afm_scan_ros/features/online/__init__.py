"""Corrections of a scan while it runs: line feedback, and adaptation to a scanner that changes."""

COMMANDS = {"adapt": "Accept into the model what changed in the scanner during a scan."}
ONLINE = {
    "line_feedback": "afm_scan_ros.features.online.line_feedback:LINE_FEEDBACK",
    "adapt": "afm_scan_ros.features.online.adapted_scan:ADAPT",
}
