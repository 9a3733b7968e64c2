"""Campaigns: a plan file becomes many labelled runs in a folder that survives being killed."""

from elevon.campaign.dataset import Dataset, Table, load_campaign, load_run
from elevon.campaign.execute import CampaignResult, resume_campaign, run_campaign
from elevon.campaign.grammar import Plan, load_plan
from elevon.campaign.resolve import resolve_plan
from elevon.campaign.resolved import Resolved
from elevon.campaign.resolved_file import read_resolved
from elevon.campaign.store import Manifest, read_manifest

__all__ = [
    "CampaignResult",
    "Dataset",
    "Manifest",
    "Plan",
    "Resolved",
    "Table",
    "load_campaign",
    "load_plan",
    "load_run",
    "read_manifest",
    "read_resolved",
    "resolve_plan",
    "resume_campaign",
    "run_campaign",
]
