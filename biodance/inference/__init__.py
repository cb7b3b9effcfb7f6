"""One posterior over everything that a session may show: body, tolerances, scales, causes, and what nobody knows."""
