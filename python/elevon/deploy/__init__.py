"""An actuator for other tools: FMUs, and the document that the C interface runs."""

from elevon.deploy.document import RunDocument, run_document
from elevon.deploy.fmu import FmuFile, export_fmu

__all__ = ["FmuFile", "RunDocument", "export_fmu", "run_document"]
