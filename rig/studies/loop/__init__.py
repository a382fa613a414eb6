"""The loop closed with measured data: study and page."""
