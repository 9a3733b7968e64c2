"""Remaining lives judged on growth that is drawn anew for each life, and on real histories."""

from __future__ import annotations

from studies.lives.campaign import study_lives

__all__ = ["study_lives"]
