"""``python -m elevon``."""

import sys

from elevon.cli import main

sys.exit(main())
