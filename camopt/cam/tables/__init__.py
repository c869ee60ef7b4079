"""Lift tables: camopt's own, read without smoothing, and measured ones, smoothed within their own noise or refused."""
