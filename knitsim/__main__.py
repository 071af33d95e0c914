"""``python -m knitsim``: the command knitsim."""

import sys

from knitsim.command import main

sys.exit(main())
