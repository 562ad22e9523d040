"""Sleeping, if the settings ask for it: islands of bodies at rest take no part in the step.

The chapter's design:

1. An island, bodies joined by pairs that push each other or nearly do, falls asleep when all of its bodies have been
   slow for half a second, relative to what forces change in a step, and stand on nothing that moves (``update_sleep``).
2. One step later it has its rows before those of all others. Stages begin behind them, at ``state.first``: to what is
   awake sleepers are as static bodies.
3. What code of the game may have changed is looked at: what handles have written is marked, columns that were lent are
   compared with what they held (:mod:`.lent_columns`), forces that may be others are summed and compared
   (``look_at_sleepers``). If anything is disturbed, all take part in the step; what goes on sleeping is put back to
   where it rests (``rest_sleepers``).
4. Pairs of two bodies that are still are no candidates (``leave_out_still``). Their contacts and their impulses are
   kept elsewhere (:mod:`.stored`), and go back when one of the two wakes. So it goes on as if nothing had happened.
5. An awake body that comes near a sleeper wakes its island (``find_touched``): that gets the flight that it was spared,
   and the broad and the narrow phase run again. All that happens before anything reacts to a contact.
6. Nothing of this is linked, and no column made, in worlds that do not sleep.

Reads positions, velocities, forces and what else of a body may be written. Writes position and linear_velocity of what
sleeps, the candidates, and what contacts and impulses there are.
"""
