"""Remaining lives judged on growth that is drawn anew for each life, and on real histories."""
