"""What ``import afm_scan_ros`` offers; the names are exported there."""
