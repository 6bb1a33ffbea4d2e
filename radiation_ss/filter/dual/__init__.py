"""The dual ensemble Kalman filter."""
