"""Campaigns: a plan file becomes many runs in a folder that survives being killed."""

from elevon.campaign.execute import CampaignResult, run_campaign
from elevon.campaign.folder import Manifest, load_run, read_manifest
from elevon.campaign.plan import Plan, load_plan
from elevon.campaign.resolve import PlannedRun, resolve_plan

__all__ = [
    "CampaignResult",
    "Manifest",
    "Plan",
    "PlannedRun",
    "load_plan",
    "load_run",
    "read_manifest",
    "resolve_plan",
    "run_campaign",
]
