"""From the bytes on the wire to angles: logs, campaigns, calibration."""
