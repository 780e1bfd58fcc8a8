"""From corrected rate to soil moisture: curve, site file, calibration."""
