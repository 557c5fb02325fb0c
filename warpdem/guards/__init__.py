"""What watches a run: each guard notices one way in which a result becomes worthless, and names grain, place and time.

A guard ends a run with an error (exit code 3). What ends it in good order, such as grains at rest, is none: CONTRIBUTING.md.

``watch`` holds them all. A new guard that looks at the state now and then is: a file with a class that has ``NAME``,
``look(view, now) -> Verdict | None`` and ``remember()``; then, in ``watch``, a line of the table in the docstring, the guard in
``Guards.__init__`` and in ``_looking``. If it keeps something from one look to the next, that belongs to the checkpoint:
numbers by ``state()`` and ``restore(state)`` of the guard, which is then in ``Guards._kept``; arrays per grain by
``Guards.arrays``, taken back in ``Guards.restore``, also where a checkpoint of an older version lacks them. Tests:
``tests/test_guards.py``; the list of guards for users: ``tests/README.md``.

A guard that looks at another time is called by ``Guards`` there: after every batch of steps (``steps_done``, as ``overlap``),
or when lists are checked and a grain is fast beside a mesh (``lists_built``, as ``travel``).
"""
