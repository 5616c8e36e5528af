"""Commands that send goals: `call`, `attach` (follow one that runs), `show` (a goal to fill in)."""
