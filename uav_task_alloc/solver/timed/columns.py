# SPDX-License-Identifier: Apache-2.0
"""What the columns of the arrays hold that kernels of problems with time take: names of them."""

# columns of TimedArrays.fixed, by node
X, Y, Z, SERVICE, OPENS, CLOSES, RELEASE, LOAD = range(8)  # RELEASE: no earlier leg to it
TRIP_RELEASE, DUE, WEIGHT, WORTH, WIDTH, REMOTE, ANNOUNCED, BASE_WAY = range(8, 16)
FIXED_COLUMNS = 16
# columns of TimedArrays.begin, by UAV: ready for its first leg, time in the air by then, latest
# departure, length and time of its route without tasks, whether this trip began at the base,
# cruise speed, whether it has locked tasks, what each second costs by which they are delayed, and
# the delay [s] from which one of them is late
READY, IN_AIR, LAST_DEPARTURE, EMPTY_LENGTH, EMPTY_TIME, GROUNDED, CRUISE, HELD = range(8)
HELD_RATE, HELD_SLACK = range(8, 10)
BEGIN_COLUMNS = 10
# columns of TimedArrays.weight
# FINISH_FROM: [s] from which on the search counts the end of each route, not only the last one;
# BY_EXCESS: of a metre beyond range or endurance, inf: not allowed
BY_DISTANCE, BY_FINISH, BY_LATENESS, FINISH_FROM, BY_EXCESS = range(5)
# columns of TimedRoutes.link, by node
NEXT, PREV, OF_UAV, HEAD = range(4)  # OF_UAV: m where a task is in no route
# columns of TimedRoutes.way, by node: row of TimedArrays.fixed and point where it begins and ends
ENTER, LEAVE = range(2)
# columns of TimedRoutes.reach, by node: its longest leg [m] to a task, to another node; and of
# TimedRoutes.gap: its longest time [s] from a departure to the latest start after such a leg.
# -inf: there is none, inf: places there are tried however far away, or however late
INNER, OUTER = range(2)
# columns of TimedRoutes.row, by node; LEG: to the next one, LEG_TO: from the one before, of tasks
START, DEPARTURE, LATEST, WARP_BEFORE, WARP_AFTER, LEG, TIME, LEG_TO = range(8)
RATE, LOAD_BEFORE, LENGTH_BEFORE, LASTED, LEFT, LASTS, EARLY, WAITS = range(8, 16)
ROW_COLUMNS = 16
# columns of TimedRoutes.trip and TimedArrays.limit, by slot
CARRIED, FLOWN, AIRBORNE = range(3)  # load, length, duration
TRIP_COLUMNS = 4
# columns of TimedRoutes.route, by UAV; WARP to ENDURANCE_EXCESS are also those of sums
WARP, LOAD_EXCESS, RANGE_EXCESS, ENDURANCE_EXCESS, METRES, TIME_COST, END, TASKS = range(8)
ROUTE_COLUMNS = 8
# further columns of TimedRoutes.sums; BEYOND: [s] of the ends of all routes after FINISH_FROM
FINISH, UNSERVED_COST, SERVED_WORTH, BEYOND = range(6, 10)
SUM_COLUMNS = 10
# entries of TimedRoutes.counts
INFEASIBLE, SERVED = range(2)  # routes with excess, tasks served
