"""Contacts between grains and walls: where a grain touches a wall, and the forces there.

    plane, revolved, sphere    closest point of an analytic wall (cylinder and cone are ``revolved``)
    shapes                     the list of these, and the choice among them
    triangle, feature          closest point of a triangle, and of any feature: a triangle or an analytic wall
    surface                    all features of the walls as kernels see them
    candidates                 which features a grain may reach until its list is built again
    contact_points             from closest points to contact points: where many triangles meet, a grain has one contact
    contact                    one contact point: its force, by the law of ``kernels.contact.law``
    evaluate                   the contact points of a grain: search, history of the step before, sum of the forces
    sweep                      the contact points of many grains, side by side in the lanes of a CPU's registers
    mobility                   how a free wall yields where it is pushed
    record                     what a wall contact remembers, and what the last force call made of it
    images                     walls at their periodic images
    distance                   signed distance to a mesh

No file here is a model that a scene names: which shapes are compiled follows from the walls that it has.

A new analytic shape is a file here and its entry in ``shapes.SHAPES``; in ``warpdem`` a class of its keys in
``scene/shapes/``, which says all that fills, checks, draws and repeats walls asks of it (``scene.shapes.shape.Shape``), and its
key in ``scene.walls.Wall``; an entry in ``tests/kernels/wall/test_shapes.py``; what is generated from the keys. ``WIDTH`` in
``surface`` grows if it has more numbers. A shape of USD becomes one of these in ``usd.walls``.
"""
