"""The clock of a batch of steps: named conditions and counters in one array, which kernels write and the host reads.

Where a graph runs the steps, its conditions say what comes next, so that the host need not look until the batch is done:

    RUN                   1 while there are steps to do: condition of the loop
    CHECK_LISTS           1 when a grain has moved too far for the inner list: condition of the branch that checks the lists
    BUILD_OUTER           1 when the outer list is out of date: condition of the branch that builds it
    BUILD_INNER           1 when the inner list is to be built: condition of the branch that builds it
    ASK_HOST              1 when the host has to look, for the reasons that ``displacement`` and ``rebuild`` give
    SCHEDULE_ROW          of the present step
    STEPS_LEFT            to do
    STEPS_DONE            since the batch began
    PARITY                of the number of the present step: which generation of the wall contacts is the old one
    HOLD_FORCES           1: the forces of the last step are left to the next batch
    MOVED_AT              steps of the loop's body after which a grain had moved too far, 0 when none has
    BEYOND_LISTS          1 when it was that, 0 when a grain only left the domain
    DEEP_AT               1 + steps of the body after which an overlap was above the limit, 0 when none was
    CONTACT_LANES         lanes of the contact batches of the inner list
    FORCE_SLOTS           of the pair forces, two per contact
    WALL_GRAINS           grains beside a wall
    INNER_BUILDS          inner lists built in the batch
    LATEST_BUILD          steps done at the last of them
    OUTER_BUILDS_LEFT     outer lists that may still be built before the host sorts the grains in memory
    OUTER_NOT_BEFORE      steps done before which the host is asked for an outer list; 0: never
"""

import warp as wp

SLOTS = 20
(
    RUN, CHECK_LISTS, BUILD_OUTER, BUILD_INNER, ASK_HOST, SCHEDULE_ROW, STEPS_LEFT, STEPS_DONE, PARITY, HOLD_FORCES, MOVED_AT,
    BEYOND_LISTS, DEEP_AT, CONTACT_LANES, FORCE_SLOTS, WALL_GRAINS, INNER_BUILDS, LATEST_BUILD, OUTER_BUILDS_LEFT,
    OUTER_NOT_BEFORE,
) = range(SLOTS)  # fmt: skip
TOTALS = slice(CONTACT_LANES, WALL_GRAINS + 1)
"""Length of the inner list, as ``numbering`` writes it."""


@wp.func
def forces_due(clock: wp.array(dtype=wp.int32), ahead: int, stage: int) -> bool:
    """Whether the forces ``ahead`` steps from now are wanted; those of a stage belong to the step that begins there."""
    if clock[MOVED_AT] != 0 or clock[DEEP_AT] != 0:
        return False
    if stage > 0:
        return ahead < clock[STEPS_LEFT]
    return ahead < clock[STEPS_LEFT] or (ahead == clock[STEPS_LEFT] and clock[HOLD_FORCES] == 0)
