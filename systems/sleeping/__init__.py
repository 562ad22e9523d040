"""Sleeping, if the settings ask for it: islands of bodies at rest take no part in the step.

The chapter's design:

1. An island, bodies joined by pairs that push each other or nearly do, falls asleep when all of its bodies have been
   slow for half a second, relative to what forces change in a step, and stand on nothing that moves (``update_sleep``).
2. Forces and integrators treat all bodies alike. After the flight each sleeper is compared with what the same flight
   made of it when it fell asleep. If these bits are the same, nothing has pushed, moved or changed it, and it is put
   back to where it rests (``rest_sleepers``); if not, its island is awake, with the flight that it has just had.
3. Pairs of two bodies that are still are no candidates (``leave_out_still``). Their contacts and their impulses are
   kept elsewhere (:mod:`.stored`), and go back when one of the two wakes. So it goes on as if nothing had happened.
4. An awake body that comes near a sleeper wakes its island (``find_touched``): that gets its flight back, and the
   broad and the narrow phase run again. All that happens before anything reacts to a contact.
5. Nothing of this is linked, and no column made, in worlds that do not sleep.

Reads positions, velocities, forces and what else of a body may be written. Writes position and linear_velocity of what
sleeps, the candidates, and what contacts and impulses there are.
"""
