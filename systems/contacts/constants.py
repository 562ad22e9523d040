"""Constants of contacts at rest, each with its unit and its reason.

Extent: the smallest full extent of the smaller body of a pair. Soft contacts are springs, so stiff that their period is
a few substeps: how much they sag follows from the substeps alone, never from the masses.
"""

from __future__ import annotations

# The spring of a soft contact.
FREQUENCY = 0.25  # times the rate of the substeps; above .5 an explicit spring is unstable
DAMPING_RATIO = 10.0  # at the usual number of substeps; overdamped, so that pushing out gives little speed
TURNING_FREQUENCY = 0.125  # where bodies turn, of pairs with several points: with .25 ten boxes lean by .2; and the
# most of springs of joints: faster ones hold, as with more springs at a light body gain
STATIC_STIFFNESS = 1.4  # times that where one of the two is static: with 1 a crate settles at 1.2 mm/s on its floor

# How fast overlap is pushed out. A bounded push bounds the force, so the bound grows with the load: the sag under the
# last impulse is pushed out as well, or jammed bodies would keep overlaps of .15.
FULL_PUSH_OVERLAP = 0.03  # extents: more overlap does not push faster; .2 lets rooms of mixed masses gain energy

# Passes over the rows in a substep.
RELAX_PASSES = 2  # after the pass that pushes: they take back the speed that pushing has given
LAST_RELAX_PASSES = 4  # of the last substep, whose velocities stay: with 2 a tower of 200 boxes moves at .02 m/s
TURNING_RELAX_PASSES = 1  # of each where bodies spin: the friction of a row follows its normal, not all normals
FRICTION_OVERRELAXATION = 1.5  # of the impulse that stops a row from sliding, in all passes of a substep but the last:
# a stored impulse is a spring without a damper, so columns sway, and only passes take energy; below 2 they do
REFINED_PASSES = 8  # of each substep of an island with more: columns under heavy bodies sway with 2, pyramids with 12
MOST_REPEATS = 1024  # substeps of an island, beyond which the heaviest count as lighter, and a fault says so; and
# turns of passes over rows that are not solved, or passes until hard islands agree;
ISLAND_WORK = 20_000  # rows at most in all of these, and in all substeps of an island, if they are more than usual
FINER_PASSES = 32  # an island for which that is more passes is solved as much better
STRUCK_EXCESS = 0.01  # extents per step: an island with a row whose speed is wrong by more is solved further, what
# closes slower strikes nothing, and a fault tells where contacts would have made an island faster by more

# Joints that hold: springs that the passes which push solve, as soft as contacts, and the others as if they were none.
JOINT_DAMPING_RATIO = 2.0
MOST_RATIO = 16.0  # between the masses of joined bodies: above it joints are solved at once, as those of beams and
FRAME_BEND = 4.0  # frames are, which bend by this times the square of their welds as much as one
DIRECT_STIFFNESS = 1e3  # times as stiff those are, and times that in the passes that do not push,
DIRECT_STIFFNESS_MAX = 1e11  # at most against what moves at them: more is rounding

# The number of substeps of an island.
MOST_SAG = 0.005  # extents: no contact sags more under the island's heaviest body,
MOST_SWAY = 0.1  # of its length: no joint swings farther in a substep where it bears the heaviest body of joints
LIMIT_STRIKE = 0.25  # extents per step, or rad of a limit: a faster blow on jointed bodies
STRUCK_JOINT_SUBSTEPS = 32  # needs so many substeps, or it tears them
OWN_SAG = 0.002  # nor a contact under one body alone: grains, whose contacts are hard
STRIKE_SUBSTEPS = 4.0  # substeps for each extent per step that a light body is closed on, times the ratio of masses
LEAST_WORK_SUBSTEPS = 64  # are allowed whatever the size of an island, see ISLAND_WORK

# What contacts may add to the energy of their island in a step.
GAIN_PUSH = 0.004  # of the energy at the speed of pushing,
GAIN_WEIGHT = 2.5  # of the energy that forces give from rest: towers that are pushed out need it
GAIN_ROUNDING = 1e-12  # of an energy: less is none

# Hard contacts of bodies that nothing presses on.
NEGLIGIBLE = 1e-9  # of an extent: a smaller gap, overlap or way in a step is none, and hard islands agree where passes
# change no way in a substep by more; of an impulse, or of the one that forces give in a step
UNREACHED = 1e6  # extents: a row that is left to the next step

# What is remembered of a step.
SAME_PLACE_EXTENTS = 0.2  # extents: so near a point is the one of the step before
WARM_START_MAX = 4.0  # of what forces give an island in a step: what is more was a blow, and not what holds it
