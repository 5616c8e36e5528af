"""Commands that end goals: `cancel` (of one action), `stop` (everything, and holds agents)."""
