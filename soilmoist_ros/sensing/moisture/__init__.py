"""The site file, the calibration of N0 with soil cores, and the calibration curve to soil moisture."""
