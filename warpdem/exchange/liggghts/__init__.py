"""Scripts of LIGGGHTS as scenes: meshes, materials, walls, contact law, insertion, motions.

In the order of the conversion: ``script`` (lines and variables), ``deck`` (what the script sets up, and when), ``contact``,
``walls``, ``motion``, ``insertion`` (tables of a scene), ``scene`` (all of them), ``convert`` (the scene file). What has no
counterpart becomes a note that names the line.
"""
