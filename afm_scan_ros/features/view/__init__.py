"""A live view of scans and of bags in the viewer Rerun, in processes of its own."""

COMMANDS = {"view": "Show a running scan, or a bag, in a viewer."}
VIEWS = {"view": "afm_scan_ros.features.view.beside:VIEW"}
