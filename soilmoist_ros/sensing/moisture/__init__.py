"""The site file, the calibration of N0 with soil cores, and the curve from count rate to soil moisture."""
