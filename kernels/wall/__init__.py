"""Contacts between grains and walls: where a grain touches a wall, and the forces there.

    plane, revolved, sphere    closest point of an analytic wall (cylinder and cone are ``revolved``)
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

A new analytic shape is, here: a file with its ``closest``; its numbers and its count in ``surface``; its branch in ``feature``;
its count where features are gone through (``candidates``, ``images``, ``lists.flight``, ``measure.readings``,
``api.mesh_wall``). In ``warpdem``: a class in ``scene.wall_shapes`` with ``numbers`` and ``nearest``, in ``Shape`` and
``SHAPES``, and its key in ``scene.walls``; its count in ``model.features``, ``model.choose_features`` and ``model.compiled``;
its upload in ``model.walls``; its periodic images in ``model.wall_images``; its triangles, for pictures and files, in
``mesh.tessellation``; what fits into it in ``filling.start_check``, and whether it holds what falls in ``engine.open_below``;
``usd.walls``. Tests: ``tests/kernels/wall`` and ``tests/test_wall_shapes.py``; the schema.
"""
