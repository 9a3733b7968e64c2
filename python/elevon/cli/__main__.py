"""``python -m elevon.cli``."""

import sys

from elevon.cli import main

sys.exit(main())
