"""Lift tables: camopt's own, read back unsmoothed, and measured ones, smoothed within their own noise or refused."""
