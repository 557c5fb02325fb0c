"""A scene as data: the keys a user may give, checked, in SI units; reading and writing of scene files.

``model.Scene`` is the whole scene; each of its tables is a class in a file of its own. ``file.load_scene`` reads TOML or USD.
``models`` finds contact laws, fields, observers and integrators by their name in the scene, ``user_models`` those in files of
the user.
"""
