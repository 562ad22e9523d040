"""``carom trade``: what settings cost in a scene or a game, what they buy, and the cheapest that do.

subject builds the scene; grid finds the settings that matter in it and runs them; errors compares each run with the
reference; trade chooses; answer says why; chart draws; command prints.
"""
